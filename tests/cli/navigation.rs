//! `subap navigation`: contents of a log, and a track that other commands read.

use std::fs;

use subaperture_tests::subap::{listing, run};

/// NovAtel's CRC-32: reflected 0xEDB88320 from 0, without a final complement.
fn crc(text: &str) -> u32 {
    text.bytes().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| match c & 1 {
            1 => (c >> 1) ^ 0xEDB8_8320,
            _ => c >> 1,
        })
    })
}

/// Record `n` of a log at 20 records per second, moving north at 1 m/s.
fn line(n: u32) -> String {
    let (seconds, latitude) = (1000.0 + f64::from(n) * 0.05, 51.1 + f64::from(n) * 4.493e-7);
    let text = format!(
        "INSPVAA,COM1,0,31.0,FINESTEERING,1820,{seconds:.3},00000000,54e2,12002;1820,{seconds:.3},{latitude:.9},-114.03,1063.0,\
         1.0,0.0,0.0,0.1,0.2,0.0,INS_SOLUTION_GOOD"
    );
    format!("#{text}*{:08x}\r\n", crc(&text))
}

#[test]
fn damaged_log_reports_losses_and_gives_a_track() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut log: Vec<String> = (0..200).map(line).collect();
    log.drain(50..60);
    log[20] = log[20].replace("1063.0", "1064.0");
    log[30].truncate(70);
    fs::write(at.join("drive.asc"), log.concat()).unwrap();
    let ran = run(at, "navigation drive.asc -o track.csv");
    let printed = ran.succeeded();
    assert!(
        printed.contains(
            "INSPVA    188 records over 9.950 s from week 1820, 1000.000 s, interval 0.0500 s"
        ),
        "{printed}"
    );
    assert!(
        printed.contains("lost: 1 record from 0.950 s to 1.050 s after the first"),
        "{printed}"
    );
    assert!(
        printed.contains("lost: 10 records from 2.450 s to 3.000 s after the first"),
        "{printed}"
    );
    assert!(printed.contains("times are GPS"), "{printed}");
    ran.reports("2 truncated or damaged messages");
    let files: Vec<String> = listing(at)
        .keys()
        .filter_map(|path| path.file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    assert_eq!(files, ["drive.asc", "track.csv", "track.png"]);
    // A scenario reads the track; it heads north along y at 1 m/s.
    let track = fs::read_to_string(at.join("track.csv")).unwrap();
    let rows: Vec<&str> = track
        .lines()
        .filter(|line| !line.starts_with('#'))
        .collect();
    assert_eq!(rows[0], "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg");
    let last: Vec<f64> = rows[188]
        .split(',')
        .map(|cell| cell.parse().unwrap())
        .collect();
    // 4.493e-7 degrees are 0.05 m within a part in a thousand.
    assert!(
        (last[2] - 9.95).abs() < 0.02 && last[1].abs() < 1e-3,
        "{last:?}"
    );
    assert!((last[6] - 90.0).abs() < 1e-6, "{last:?}");
    // The track is also a log, and the command replaces its own file.
    assert!(
        run(at, "navigation track.csv")
            .succeeded()
            .contains("CSV       188 records")
    );
    run(at, "navigation drive.asc -o track.csv -q").succeeded();
    let json = run(at, "navigation drive.asc --json")
        .succeeded()
        .to_owned();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["schema"], "subaperture-navigation");
    assert_eq!(
        (&json["wrong"]["checksum"], &json["wrong"]["cut"]),
        (&1.into(), &1.into())
    );
}

#[test]
fn southern_origins_are_taken_with_or_without_equals_sign() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let rows: String = (0..5)
        .map(|n| format!("{n},-33.5,{:.6},100\n", 151.5 + f64::from(n) * 1e-5))
        .collect();
    fs::write(
        at.join("south.csv"),
        format!("time_s,lat_deg,lon_deg,height_m\n{rows}"),
    )
    .unwrap();
    for typed in ["--origin -33.5,151.5,0", "--origin=-33.5,151.5,0"] {
        run(at, &format!("navigation south.csv {typed} -o t.csv")).succeeded();
        let track = fs::read_to_string(at.join("t.csv")).unwrap();
        let rows: Vec<&str> = track
            .lines()
            .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
            .collect();
        assert_eq!(rows.len(), 5);
        let first: Vec<f64> = rows[0].split(',').map(|x| x.parse().unwrap()).collect();
        assert!(first[1].abs() + first[2].abs() < 1e-3 && (first[3] - 100.0).abs() < 1e-3);
    }
}

#[test]
fn repeated_times_and_assumed_heights_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let rows: String = (0..8)
        .map(|n| format!("{},44.25,-121.5,100\n", n / 2))
        .collect();
    fs::write(
        at.join("twice.csv"),
        format!("time_s,lat_deg,lon_deg,height_m\n{rows}"),
    )
    .unwrap();
    let ran = run(at, "navigation twice.csv -o t.csv");
    ran.succeeded();
    assert!(
        ran.stderr
            .contains("4 records with times that do not ascend")
            && !ran.stderr.contains("damaged"),
        "{}",
        ran.stderr
    );
    let plain: String = (40..48)
        .map(|s| format!("$GPGGA,1106{s}.00,4415.0,N,12130.0,W,4,12,0.8,50.000,M,,M,,\r\n"))
        .collect();
    fs::write(at.join("plain.nmea"), plain).unwrap();
    let ran = run(at, "navigation plain.nmea");
    assert!(ran.succeeded().contains("NMEA      8 records"));
    ran.reports("heights assume 0 m");
}

#[test]
fn files_other_than_logs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("noise.asc"), [0x5a; 4000]).unwrap();
    fs::write(at.join("track-m.csv"), "time_s,x,y,z\n0,1,2,3\n").unwrap();
    run(at, "navigation noise.asc -o track.csv").failed(1, &["noise.asc", "no record of NovAtel"]);
    run(at, "navigation track-m.csv").failed(1, &["track-m.csv", "column 'x'", "has no unit"]);
    run(at, "navigation none.asc").failed(1, &["cannot read none.asc"]);
    fs::write(at.join("drive.asc"), line(0) + &line(1)).unwrap();
    run(at, "navigation drive.asc -o t.csv --record nmea").failed(1, &["of the requested type"]);
    run(at, "navigation drive.asc -o t.csv --origin 91,0,0").failed(1, &["--origin"]);
    run(at, "navigation drive.asc --record inspva").failed(2, &["--out"]);
    assert_eq!(listing(at).len(), 3);
}
