//! Tracks: navigation logs, comma-separated values and Motive's takes.

use std::path::Path;

use glam::DVec3;
use subaperture::io::track_axes::TrackAxes;
use subaperture::io::{motive, pattern_csv, phase_csv, target_csv, track_csv};
use subaperture::navigation::{Kind, Log, Options, Place};
use subaperture::track::{Fix, SampledTrack, Trajectory};

pub(super) const NOVATEL_WORDS: &[&str] = &[
    "#INSPVAA",
    "#INSPVAXA",
    "#BESTPOSA",
    "%INSPVASA",
    ";",
    ",",
    "*",
    "\r\n",
    "INS_SOLUTION_GOOD",
    "SOL_COMPUTED",
    "WGS84",
    "UNKNOWN",
    "INS_ALIGNING",
    "FINESTEERING",
];

pub(super) const PHASE_WORDS: &[&str] = &[
    "pulse",
    "phase_rad",
    ",",
    "\n",
    "#",
    "0",
    "1",
    "NaN",
    "1e12",
];

pub(super) const PATTERN_WORDS: &[&str] = &[
    "azimuth_deg",
    "elevation_deg",
    "gain_db",
    ",",
    "\n",
    "#",
    "0",
    "-180",
    "90",
    "1e-300",
    "NaN",
];

pub(super) const NAVIGATION_WORDS: &[&str] = &[
    "$GPGGA,",
    "$GPRMC,",
    "$GNZDA,",
    "$GPGST,",
    "$GPVTG,",
    "$GPHDT,",
    "*",
    ",",
    "\r\n",
    "time_s",
    "latitude_deg",
    "longitude_deg",
    "height_m",
    "velocity_x_m_s",
    "heading [deg]",
    "sigma_",
    "235959.99",
    "311216",
];

pub(super) const CSV_WORDS: &[&str] = &[
    "time_s",
    "x_m",
    "y_m",
    "z_m",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    ",",
    "\n",
    "#",
    "\u{feff}",
];

pub(super) const MOTIVE_WORDS: &[&str] = &[
    "Format Version",
    "Length Units",
    "Millimeters",
    "Meters",
    "Rotation Type",
    "Quaternion",
    "Coordinate Space",
    "Global",
    "Rigid Body",
    "Rotation",
    "Position",
    "Frame",
    "Time (Seconds)",
    ",",
    "\n",
    "\"",
];

pub(super) fn motive_seeds() -> Vec<Vec<u8>> {
    let take = |units: &str, rotation: &str, letters: &str, rows: &str| {
        let columns = letters.split(',').count();
        let every = |word: &str| format!(",{word}").repeat(columns);
        let names = every("radar");
        let [bodies, numbers] = ["Rigid Body", "1"].map(every);
        format!(
            "Format Version,1.23,Take Name,walk,Rotation Type,Quaternion,Length Units,{units},Coordinate Space,Global\n\
             \n,Type{bodies}\n,Name{names}\n,ID{numbers}\n,{rotation}\nFrame,Time (Seconds),{letters}\n{rows}"
        )
        .into_bytes()
    };
    let turned = format!("{}{}", ",Rotation".repeat(4), ",Position".repeat(3));
    vec![
        take(
            "Millimeters",
            &turned,
            "X,Y,Z,W,X,Y,Z",
            "0,0.0,0,0,0,1,100,1500,-20\n1,0.01,,,,,,,\n2,0.02,0,0.38268343,0,0.92387953,110,1500,-20\n",
        ),
        take(
            "Meters",
            &",Position".repeat(3),
            "X,Y,Z",
            "0,0.0,0.1,1.5,-0.2\r\n1,0.01,0.11,1.5,-0.2\r\n2,0.02,0.12,1.6,-0.2\r\n",
        ),
    ]
}

pub(super) fn novatel_seeds() -> Vec<Vec<u8>> {
    let header = "COM1,0,58.5,FINESTEERING,2209,502061.000,02000020,18bc,16809";
    let inspva = |t: f64, latitude: f64| {
        format!(
            "#INSPVAA,{header};2209,{t:.3},{latitude:.11},-114.03067932,1081.0036,1.5,-2.0,0.25,3.0,-1.5,270.0,\
             INS_SOLUTION_GOOD*0\r\n"
        )
    };
    let bestpos = |t: f64| {
        format!(
            "#BESTPOSA,COM1,0,58.5,FINESTEERING,2209,{t:.3},02000020,18bc,16809;SOL_COMPUTED,PSRDIFF,51.15043699323,\
             -114.03067932462,{t:.4},-17.0,WGS84,0.4,0.4,0.8,\"AAAA\",6.0,0.0,47,35,35,33,00,06,39,33*0\r\n"
        )
    };
    let inspvax = format!(
        "#INSPVAXA,{header};INS_SOLUTION_GOOD,INS_RTKFIXED,51.15043711111,-114.03067932,1081.0036,-17.0,1.5,-2.0,0.25,\
         3.0,-1.5,270.0,0.1,0.1,0.1,0.01,0.01,0.01,0.1,0.1,0.1,00000000,0*0\r\n"
    );
    let logs = [
        inspva(502061.125, 51.150437)
            + &inspva(502061.25, 51.150438)
            + &inspva(502061.375, 51.150439),
        bestpos(100.0) + &bestpos(101.0) + "#TIMEA,x;y*0\r\n",
        inspvax + "\r\n%SHORTA,1;2*0\r\n",
    ];
    let binary = [
        message(507, 0x12, &[(4, 2209), (8, 100), (8, 51), (8, -114)], 88),
        message(
            1465,
            0x12,
            &[(4, 3), (4, 56), (8, 43), (8, -80), (8, 326)],
            126,
        ),
        message(
            42,
            0x12,
            &[
                (4, 0),
                (4, 16),
                (8, 43),
                (8, -80),
                (8, 326),
                (4, 0),
                (4, 61),
            ],
            72,
        ),
        message(
            231,
            0x12,
            &[(4, 2209), (8, 100), (8, 0), (8, 0), (8, -18)],
            40,
        ),
        message(508, 0x13, &[(4, 2209), (8, 101), (8, 51), (8, -114)], 88),
    ];
    let texts = logs.map(String::into_bytes).into_iter();
    let all = texts.chain([binary.concat()]);
    all.map(|mut bytes| {
        super::repair::novatel(&mut bytes);
        bytes
    })
    .collect()
}

/// A NovAtel binary message whose body begins with integers of 4 or 8 bytes; the CRC is not set.
fn message(id: u16, sync: u8, numbers: &[(usize, i32)], length: usize) -> Vec<u8> {
    let week_and_ms = [0xa1, 8, 0xa0, 0x86, 1, 0];
    let id = id.to_le_bytes();
    let mut bytes = match sync {
        0x12 => vec![
            0xaa,
            0x44,
            0x12,
            28,
            id[0],
            id[1],
            0,
            0,
            length as u8,
            0,
            0,
            0,
            0,
            180,
        ],
        _ => vec![0xaa, 0x44, 0x13, length as u8, id[0], id[1]],
    };
    bytes.extend(week_and_ms);
    let header = if sync == 0x12 { 28 } else { 12 };
    bytes.resize(header, 0);
    for &(size, number) in numbers {
        match size {
            4 => bytes.extend(number.to_le_bytes()),
            _ => bytes.extend(f64::from(number).to_le_bytes()),
        }
    }
    // The rest is 0, except for the status at the end of INSPVA.
    bytes.resize(header + length - 4, 0);
    bytes.extend(3u32.to_le_bytes());
    bytes.extend([0; 4]);
    bytes
}

pub(super) fn navigation_seeds() -> Vec<Vec<u8>> {
    let sentences = "$GPGGA,235959.50,5109.0262,N,11401.8407,W,4,12,0.9,1097.5,M,-17.0,M,,*0\r\n\
                     $GPRMC,235959.50,A,5109.0262,N,11401.8407,W,3.6,90.0,311216,,,A*0\r\n\
                     $GPGST,235959.50,1.0,,,,0.25,0.5,0.75*0\r\n$GPHDT,95.5,T*0\r\n\
                     $GPGGA,000000.50,5109.0362,N,11401.8407,W,4,12,0.9,1098.5,M,-17.0,M,,*0\r\n\
                     $GPVTG,180.0,T,,M,7.2,N,13.3,K*0\r\n$GPZDA,000001.50,01,01,2017,,*0\r\n";
    let trajectory = (0..4).flat_map(|n| {
        let mut numbers = [0.25; 17];
        numbers[0] = 1000.0 + f64::from(n) * 0.005;
        numbers.into_iter().flat_map(f64::to_le_bytes)
    });
    let values = "# a flight\ntime [ms],latitude_deg,longitude_rad,height_km,heading_deg,pitch_deg,roll_deg,velocity_east_km_h,\
                  velocity_north_m_s,velocity_up_m_s,sigma_x_cm,sigma_y_cm,sigma_z_cm\n\
                  1500,45,0.1,0.12,90,10,20,36,0.5,0,10,20,30\n1600,45,0.1,0.12,,,,36,0.5,0,10,20,30\n";
    let mut all = vec![
        sentences.as_bytes().to_vec(),
        trajectory.collect(),
        values.as_bytes().to_vec(),
        b"time_s,x_m,y_m,z_m,yaw_deg\n0,1,2,3,4\n1,2,3,4,5\n".to_vec(),
    ];
    super::repair::novatel(&mut all[0]);
    all
}

pub(super) fn csv_seeds() -> Vec<Vec<u8>> {
    [
        "time_s,x_m,y_m,z_m\n0,1,2,3\n0.5,2,2.5,3\n1,3,2,3\n",
        "\u{feff}# flight\nz_m,x_m,y_m,yaw_deg,roll_deg,pitch_deg,time_s\r\n\r\n300,1,2,90,0,0,0.5\n301,-1e1,2.5,0,30,0,1\n",
        "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad\n0,0,0,0,0,0.5,0\n1,1,0,0,0,0.25,0.125\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

/// Assert that a track through fixes is finite at any time.
fn follow(fixes: &[Fix]) -> String {
    let places = fixes
        .iter()
        .all(|fix| fix.position_m.is_finite() && fix.time_s.is_finite());
    assert!(places, "a fix that is not finite");
    let track = match SampledTrack::new(fixes) {
        Ok(track) => track,
        Err(error) => return error.to_string(),
    };
    let (first, last) = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    for n in 0..=8 {
        let pose = track.pose(first + (last - first) * f64::from(n) / 8.0);
        let ahead = pose.attitude * DVec3::X;
        assert!(pose.position_m.is_finite(), "{pose:?}");
        assert!((ahead.length() - 1.0).abs() < 1e-6, "{pose:?}");
    }
    "a track".to_owned()
}

/// A log of any format: its records are valid, ordered and accounted for.
pub(super) fn log(bytes: &[u8]) -> String {
    let options = Options {
        week: (super::choice(bytes, 2) == 0).then_some(2209),
        ..Options::default()
    };
    let log = match Log::read_from(bytes, Path::new("input.log"), &options) {
        Ok(log) => log,
        Err(error) => {
            return error
                .to_string()
                .lines()
                .next()
                .unwrap_or_default()
                .to_owned();
        }
    };
    let account = &log.account;
    assert_eq!(account.bytes, bytes.len() as u64, "{account}");
    assert!(account.lost_bytes <= account.bytes && account.faults.len() as u64 <= account.faulty());
    for record in &log.records {
        if let Some(Place::Earth(place)) = record.place {
            assert!(place.latitude_deg.abs() <= 90.0 && place.longitude_deg.abs() <= 180.0);
            assert!(place.to_ecf_m().is_finite());
        }
        assert!(record.time.seconds.is_finite() && record.byte < account.bytes);
        assert!(record.velocity_m_s.is_none_or(DVec3::is_finite));
        let spreads = [record.place_sigma_m, record.velocity_sigma_m_s];
        let sound = |v: DVec3| v.is_finite() && v.min_element() >= 0.0;
        assert!(spreads.into_iter().flatten().all(sound));
    }
    let mut outcome = format!("{} other kinds", account.others.len().min(4));
    for coverage in log.coverage() {
        let times = || log.of(coverage.kind).map(|record| record.time);
        assert!(times().zip(times().skip(1)).all(|(a, b)| b.since(a) > 0.0));
        let Some(frame) = log.frame() else { continue };
        outcome += coverage.kind.name();
        outcome += &match log.fixes(coverage.kind, &frame, coverage.from) {
            Ok(fixes) => follow(&fixes),
            Err(error) => error.to_string(),
        };
    }
    assert!(log.coverage().iter().map(|one| one.records).sum::<usize>() == log.records.len());
    let kinds = Kind::ALL.map(|kind| log.of(kind).count());
    assert_eq!(kinds.iter().sum::<usize>(), log.records.len());
    outcome
}

pub(super) fn motive(bytes: &[u8]) -> String {
    let read = |body| motive::read_from(bytes, Path::new("take.csv"), body, TrackAxes::y_up());
    match (read(None), read(Some("radar"))) {
        (Ok(only), Ok(named)) => {
            assert_eq!(only, named, "the only body is the one that is named");
            follow(&only)
        }
        (Ok(fixes), Err(_)) | (Err(_), Ok(fixes)) => follow(&fixes),
        (Err(error), Err(_)) => error.to_string(),
    }
}

/// Fixes of a track. As motion of a target the same file is accepted only if its times ascend, and it is finite then.
pub(super) fn csv(bytes: &[u8]) -> String {
    if let Ok(displacement) = target_csv::read_from(bytes, Path::new("input.csv")) {
        let [first_s, last_s] = displacement.span_s().expect("a file has samples");
        assert!(first_s < last_s);
        let (moved_m, m_s) = displacement.between(first_s, 0.5 * (first_s + last_s));
        assert!(moved_m.is_finite() && m_s.is_finite());
    }
    match track_csv::read_from(bytes, Path::new("input.csv")) {
        Ok(fixes) if fixes.is_empty() => "no fixes".to_owned(),
        Ok(fixes) => follow(&fixes),
        Err(error) => error.to_string(),
    }
}

pub(super) fn phase_seeds() -> Vec<Vec<u8>> {
    [
        "pulse,phase_rad\n0,0.125\n1,-0.5\n2,1e3\n",
        "\u{feff}# written by subap\npulse, phase_rad\r\n\r\n0, -2.5e-17\r\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

pub(super) fn pattern_seeds() -> Vec<Vec<u8>> {
    [
        "azimuth_deg,elevation_deg,gain_db\n-10,0,-12.2\n0,0,0\n10,0,-12\n-10,5,-20\n0,5,-6\n10,5,-21\n",
        "\u{feff}# horn\nazimuth_deg, gain_db\r\n\r\n-180,-1e2\r\n180,17\r\n-0,23\r\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

/// Amplitudes are from 0 to 1, also after writing.
pub(super) fn pattern(bytes: &[u8]) -> String {
    let path = Path::new("input.csv");
    match pattern_csv::read_from(bytes, path) {
        Ok(table) => {
            let again = pattern_csv::read_from(pattern_csv::text(&table).as_bytes(), path);
            for table in [&table, &again.expect("a written pattern is read")] {
                for n in -8..=8 {
                    let angle = f64::from(n) * 0.4;
                    let amplitude = table.amplitude(angle, 0.5 * angle);
                    assert!((0.0..=1.0 + 1e-12).contains(&amplitude), "{amplitude}");
                }
            }
            format!("{} gains", table.gain_db().len())
        }
        Err(error) => error.to_string(),
    }
}

/// Phases are finite, and are read unchanged after writing.
pub(super) fn phases(bytes: &[u8]) -> String {
    let path = Path::new("input.csv");
    match phase_csv::read_from(bytes, path) {
        Ok(phases) => {
            assert!(phases.iter().all(|phase| phase.is_finite()));
            let again = phase_csv::read_from(phase_csv::text(&phases).as_bytes(), path);
            assert_eq!(again.expect("written phases are read"), phases);
            format!("{} phases", phases.len())
        }
        Err(error) => error.to_string(),
    }
}
