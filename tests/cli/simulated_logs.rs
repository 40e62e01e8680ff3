//! Navigation logs of `subap simulate`, read back by `subap navigation` and by the library.

use std::fs;
use std::path::Path;

use glam::DVec3;
use subaperture::geometry::{Geodetic, SceneFrame};
use subaperture::io::open::{Options as Opening, open_channels};
use subaperture::navigation::{GpsTime, Kind, Log, Options};
use subaperture::targets::Arrangement;
use subaperture::track_fusion::{About, Mounting, Navigation};
use subaperture_tests::subap::{listing, run};

/// Lever arm in body axes, metres.
const ARM_M: DVec3 = DVec3::new(-0.8, -0.3, 0.5);

/// Velocity in scene axes, m/s: the vehicle drives north-east and climbs.
const VELOCITY_M_S: DVec3 = DVec3::new(3.0, 4.0, 0.1);

/// Time 0 of the collection is 2017-05-04, 14:00:00 UTC: the fifth day of week 1947, 18 s later by GPS.
const START: GpsTime = GpsTime {
    week: 1947,
    seconds: 4.0 * 86_400.0 + 14.0 * 3600.0 + 18.0,
};

/// Scenario of a vehicle on a straight line that is at the origin at 1 s, for 3 s, with these logs.
fn scenario(logs: &str) -> String {
    let [vx, vy, vz] = VELOCITY_M_S.to_array();
    let [x, y, z] = (-VELOCITY_M_S).to_array();
    format!(
        "name = \"drive\"\ncollection_start = \"2017-05-04T14:00:00Z\"\nseed = 5\n\
         [scene]\nreference = \"-40, 30, 0 m\"\n[scene.origin]\nlatitude = \"-33.9 deg\"\nlongitude = \"151.2 deg\"\nheight = \"40 m\"\n\
         [[scene.point]]\nposition = \"-40, 30, 0 m\"\n\
         [radar]\nkind = \"ideal\"\npulses = 31\npri = \"100 ms\"\ncentre = \"1.85 GHz\"\nbandwidth = \"300 MHz\"\nsamples = 16\n\
         [[radar.transmitter]]\noffset = \"0.1, 0, 0.2 m\"\n[[radar.receiver]]\noffset = \"0.5, 0, 0.2 m\"\n\
         [platform]\nkind = \"linear\"\nat = \"start\"\nposition = \"{x}, {y}, {z} m\"\nvelocity = \"{vx}, {vy}, {vz} m/s\"\n{logs}"
    )
}

/// A log of this format with further keys.
fn log(file: &str, format: &str, more: &str) -> String {
    let [x, y, z] = ARM_M.to_array();
    format!(
        "[[log]]\nfile = \"{file}\"\nformat = \"{format}\"\nlever_arm = \"{x}, {y}, {z} m\"\nundulation = \"22.5 m\"\n{more}\n"
    )
}

fn frame() -> SceneFrame {
    SceneFrame::east_north_up(&Geodetic {
        latitude_deg: -33.9,
        longitude_deg: 151.2,
        height_m: 40.0,
    })
}

/// Body axes of the vehicle in scene axes, by hand: x along the velocity, y level and left.
fn body() -> [DVec3; 3] {
    let forward = VELOCITY_M_S.normalize();
    let left = DVec3::Z.cross(forward).normalize();
    [forward, left, forward.cross(left)]
}

/// Middle of the antennas at a time, metres.
fn middle_m(time_s: f64) -> DVec3 {
    let [forward, _, up] = body();
    VELOCITY_M_S * (time_s - 1.0) + forward * 0.3 + up * 0.2
}

/// Position of the navigation antenna at a time, metres.
fn antenna_m(time_s: f64) -> DVec3 {
    let [forward, left, up] = body();
    middle_m(time_s) + forward * ARM_M.x + left * ARM_M.y + up * ARM_M.z
}

fn read(path: &Path) -> Log {
    let options = Options {
        week: Some(START.week),
        ..Options::default()
    };
    let log = Log::read(path, &options).unwrap();
    assert_eq!(log.account.faulty(), 0, "{}", log.account);
    log
}

/// Files, kinds, and the largest position error without noise: half a step of latitude and longitude in metres, a step of height. A
/// millionth of a metre is for the conversions of coordinates.
const FORMATS: [(&str, &str, Kind, f64, f64); 4] = [
    // 1e-7 minutes are 0.19 mm.
    ("a.nmea", "nmea", Kind::Nmea, 0.5 * 1.86e-4, 1e-4),
    ("a.asc", "inspvax", Kind::Inspvax, 0.5 * 1.12e-6, 1e-4),
    ("b.asc", "bestpos", Kind::Bestpos, 0.5 * 1.12e-6, 1e-4),
    ("a.sbet", "sbet", Kind::Sbet, 0.0, 0.0),
];

#[test]
fn logs_without_noise_give_true_positions_within_their_resolution() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let logs: String = FORMATS
        .iter()
        .map(|(file, format, ..)| log(file, format, "rate = \"8 Hz\""))
        .collect();
    fs::write(at.join("drive.toml"), scenario(&logs)).unwrap();
    let json = run(at, "simulate drive.toml -o drive.cphd --json");
    let json: serde_json::Value = serde_json::from_str(json.succeeded()).unwrap();
    let listed: Vec<[&str; 2]> = json["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| [&file["path"], &file["kind"]].map(|text| text.as_str().unwrap()))
        .collect();
    let mut expected = FORMATS.map(|(file, ..)| [file, "navigation log"]).to_vec();
    expected.push(["drive.cphd", "phase history"]);
    assert_eq!(listed, expected);
    let opening = Opening::default();
    let channels = open_channels::<&str>(&at.join("drive.cphd"), None, &opening).unwrap();
    let about = About::of(&channels).unwrap();
    assert_eq!(about.start, Some(START));
    let arrangement = Arrangement::of(&channels).unwrap();
    for (file, _, kind, level_m, height_m) in FORMATS {
        let log = read(&at.join(file));
        assert!(log.account.doubts.is_empty(), "{}", log.account);
        let fixes = log.fixes(kind, &frame(), START).unwrap();
        // From -1 s to 4 s at 8 Hz.
        assert_eq!(fixes.len(), 41, "{file}");
        let [_, _, up] = body();
        for (n, fix) in (-8..).zip(&fixes) {
            assert!((fix.time_s - f64::from(n) / 8.0).abs() < 1e-9);
            let away_m = fix.position_m - antenna_m(fix.time_s);
            let level = away_m.truncate().length();
            assert!(level < level_m * 2f64.sqrt() + 1e-6, "{file} {level}");
            assert!(away_m.z.abs() < height_m + 1e-6, "{file} {away_m}");
            if let (Some(attitude), true) = (fix.attitude, kind != Kind::Nmea) {
                // Azimuths are rounded to 1e-9 degrees; the vertical turns by 1e-6 rad over some metres.
                assert!((attitude * DVec3::Z).distance(up) < 3e-6, "{file}");
            }
        }
        let speeds = log.of(kind).filter_map(|record| record.velocity_m_s);
        for velocity in speeds {
            let off = (velocity - VELOCITY_M_S).truncate().length();
            assert!(off < 1e-4, "{file} {velocity}");
        }
        // The lever arm undone, in the antennas' axes by their own positions.
        if kind == Kind::Sbet {
            continue;
        }
        let named = [(file.to_owned(), log)];
        let navigation = Navigation::of_logs(&named, &about).unwrap();
        let turn = arrangement.attitude.inverse();
        let [forward, left, up] = body().map(|axis| turn * axis);
        let mounting = Mounting {
            arm_m: forward * ARM_M.x + left * ARM_M.y + up * ARM_M.z,
        };
        let fixes = navigation.alone(&about, arrangement.attitude, &mounting);
        assert!(fixes.len() >= 41, "{file}: {}", fixes.len());
        for fix in fixes {
            let away_m = fix.position_m - middle_m(fix.time_s);
            let allowed_m = (2.0 * level_m * level_m + height_m * height_m).sqrt() + 1e-5;
            assert!(away_m.length() < allowed_m, "{file} {away_m}");
        }
    }
}

#[test]
fn noise_has_the_stated_deviation_and_outages_are_gaps() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let more = "rate = \"200 Hz\"\nhorizontal = \"5 cm\"\nvertical = \"12 cm\"\nvelocity = \"3 cm/s\"\nattitude = \"0.2 deg\"\n\
                outages = [\"0.5 s, 1 s\", \"2.001 s, 2.004 s\"]";
    let logs: String = FORMATS
        .iter()
        .map(|(file, format, ..)| log(file, format, more))
        .collect();
    fs::write(at.join("drive.toml"), scenario(&logs)).unwrap();
    run(at, "simulate drive.toml -o drive.cphd").succeeded();
    let mut firsts = Vec::new();
    for (file, _, kind, ..) in FORMATS {
        let log = read(&at.join(file));
        let records: Vec<_> = log.of(kind).collect();
        // 1001 records from -1 s to 4 s, 101 of them from 0.5 s to 1 s; none from 2.001 s to 2.004 s.
        assert_eq!(records.len(), 900, "{file}");
        let errors: Vec<DVec3> = log
            .fixes(kind, &frame(), START)
            .unwrap()
            .iter()
            .map(|fix| fix.position_m - antenna_m(fix.time_s))
            .collect();
        firsts.push(errors[0]);
        // The deviation of N samples has a standard deviation of 1 / sqrt(2 N) of it: 2.4 % of 900, 5 of them 11.8 %.
        let allowed = 5.0 / (2.0 * 900f64).sqrt();
        let squares: DVec3 = errors.iter().map(|error| error * error).sum();
        let found = (squares / 900.0).map(f64::sqrt) / DVec3::new(0.05, 0.05, 0.12);
        let away = (found - 1.0).abs().max_element();
        assert!(away < allowed, "{file} {found}");
        // Errors of neighbours are independent: their correlation has a deviation of 1 / sqrt(900).
        let pairs = errors.windows(2).map(|pair| pair[0].x * pair[1].x);
        let correlation = pairs.sum::<f64>() / 900.0 / 0.05f64.powi(2);
        assert!(correlation.abs() < 5.0 / 30.0, "{file} {correlation}");
        if kind != Kind::Sbet {
            let stated = records[0].place_sigma_m.unwrap();
            assert!(stated.distance(DVec3::new(0.05, 0.05, 0.12)) < 1e-9);
        }
        if kind == Kind::Inspvax {
            assert_eq!(records[0].velocity_sigma_m_s, Some(DVec3::splat(0.03)));
            assert_eq!(records[0].attitude_sigma_deg, Some([0.2; 3]));
            let square = |(a, b): (f64, f64)| (a - b).powi(2);
            let speeds = records.iter().map(|record| record.velocity_m_s.unwrap().x);
            let speed = speeds.map(|v| square((v, VELOCITY_M_S.x))).sum::<f64>() / 900.0;
            assert!((speed.sqrt() / 0.03 - 1.0).abs() < allowed, "{speed}");
            let heading = 90.0 - VELOCITY_M_S.y.atan2(VELOCITY_M_S.x).to_degrees();
            let azimuths = records.iter().map(|r| r.attitude.unwrap().azimuth_deg);
            let azimuth = azimuths.map(|a| square((a, heading))).sum::<f64>() / 900.0;
            assert!((azimuth.sqrt() / 0.2 - 1.0).abs() < allowed, "{azimuth}");
        }
        let json = run(at, &format!("navigation {file} --week 1947 --json"));
        let json: serde_json::Value = serde_json::from_str(json.succeeded()).unwrap();
        let kinds = json["kinds"].as_array().unwrap();
        let one = kinds.iter().find(|one| one["kind"] == kind.name()).unwrap();
        let gaps = one["gaps"].as_array().unwrap();
        assert_eq!(gaps.len(), 1, "{file}: {gaps:?}");
        assert_eq!(gaps[0]["missing"], 101);
        // From 0.495 s to 1.005 s of the collection; the log begins at -1 s.
        for (key, expected_s) in [("from_s", 1.495), ("to_s", 2.005)] {
            let found_s = gaps[0][key].as_f64().unwrap();
            assert!(
                (found_s - expected_s).abs() < 1e-6,
                "{file} {key}: {found_s}"
            );
        }
    }
    // Logs have independent errors.
    for (n, first) in firsts.iter().enumerate() {
        for other in &firsts[..n] {
            assert!(first.distance(*other) > 1e-3, "{firsts:?}");
        }
    }
}

#[test]
fn logs_are_reproducible_and_replace_only_simulated_logs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let noisy = "horizontal = \"1 m\"\nvertical = \"1 m\"";
    let logs: String = FORMATS
        .iter()
        .map(|(file, format, ..)| log(file, format, noisy))
        .collect();
    fs::write(at.join("drive.toml"), scenario(&logs)).unwrap();
    let line = "simulate drive.toml -o drive.cphd";
    let text = run(at, line);
    assert!(text.succeeded().contains("a.nmea: navigation log at 20 Hz"));
    let bytes = |file: &str| fs::read(at.join(file)).unwrap();
    let before = FORMATS.map(|(file, ..)| bytes(file));
    run(at, line).succeeded();
    assert_eq!(before, FORMATS.map(|(file, ..)| bytes(file)));
    run(at, &format!("{line} --seed 6")).succeeded();
    for (before, (file, ..)) in before.iter().zip(FORMATS) {
        assert_ne!(*before, bytes(file), "{file}");
    }
    // Logs of instruments: the SBET with accelerations, the text without the mark.
    let mut real = before[3].clone();
    real[88] = 1;
    let text = before[0].iter().position(|&b| b == b'\n').unwrap() + 1;
    for (file, content) in [("a.sbet", real), ("a.nmea", before[0][text..].to_vec())] {
        let path = at.join(file);
        let own = fs::read(&path).unwrap();
        fs::write(&path, &content).unwrap();
        let whole = listing(at);
        run(at, line).failed(1, &[file, "not a navigation log written by subap"]);
        assert_eq!(listing(at), whole);
        fs::write(&path, own).unwrap();
    }
    // A file that is also an input, and the scenario.
    let text = scenario(&log("track.csv", "nmea", ""));
    let start = text.find("kind = \"linear\"").unwrap();
    let end = text.find("[[log]]").unwrap();
    let recorded = format!(
        "{}kind = \"csv\"\nfile = \"track.csv\"\n{}",
        &text[..start],
        &text[end..]
    );
    fs::write(at.join("recorded.toml"), &recorded).unwrap();
    fs::write(
        at.join("track.csv"),
        "time_s,x_m,y_m,z_m\n0,0,0,1\n1,1,0,1\n3,3,0,1\n",
    )
    .unwrap();
    run(at, "simulate recorded.toml -o other.cphd").failed(1, &["track.csv", "input of this run"]);
    let own = recorded.replace(
        "file = \"track.csv\"\nformat",
        "file = \"own.toml\"\nformat",
    );
    fs::write(at.join("own.toml"), own).unwrap();
    run(at, "simulate own.toml -o other.cphd").failed(1, &["own.toml", "input of this run"]);
    assert!(!at.join("other.cphd").exists());
    // With raw echoes only, the logs are next to their folder.
    run(at, "simulate drive.toml --echoes raw/drive").succeeded();
    assert!(at.join("raw/a.sbet").is_file() && at.join("raw/drive/echoes.npy").is_file());
    let dry = run(at, "simulate drive.toml -o dry.cphd --dry-run");
    assert!(dry.succeeded().contains("a.nmea"), "{dry:?}");
    assert!(!at.join("dry.cphd").exists());
}

/// Twenty outages of 0.105 s, in which the inertial sensors have an acceleration error of 1 m/s^2 each: errors of velocity are this error times the time
/// since the start, errors of position half of it times the square.
#[test]
fn inertial_log_drifts_through_outages_by_constant_accelerations() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let starts_s: Vec<f64> = (0..20).map(|n| 0.15 * f64::from(n)).collect();
    let outages = starts_s
        .iter()
        .map(|s| format!("\"{:.3} s, {:.3} s\"", s, s + 0.105));
    let outages: Vec<String> = outages.collect();
    let more = format!(
        "rate = \"100 Hz\"\ndrift = \"1 m/s^2\"\noutages = [{}]",
        outages.join(", ")
    );
    fs::write(
        at.join("drive.toml"),
        scenario(&log("ins.log", "inspvax", &more)),
    )
    .unwrap();
    run(at, "simulate drive.toml -o drive.cphd").succeeded();
    let read = read(&at.join("ins.log"));
    let records: Vec<_> = read.of(Kind::Inspvax).collect();
    // From -1 s to 4 s without a gap.
    assert_eq!(records.len(), 501);
    let fixes = read.fixes(Kind::Inspvax, &frame(), START).unwrap();
    let mut squares = DVec3::ZERO;
    for (record, fix) in records.iter().zip(&fixes) {
        let start_s = starts_s
            .iter()
            .find(|s| (**s - 1e-6..=**s + 0.105).contains(&fix.time_s));
        let age_s = start_s.map_or(0.0, |start_s| fix.time_s - start_s);
        let velocity = record.velocity_m_s.unwrap() - VELOCITY_M_S;
        let moved_m = fix.position_m - antenna_m(fix.time_s);
        // Velocities are rounded to 1e-5 m/s, heights to 0.1 mm; the vertical turns by 1e-6 rad over some metres, of 5 m/s.
        let off_m = moved_m - 0.5 * age_s * velocity;
        assert!(off_m.length() < 1.5e-4, "{fix:?}: {off_m}");
        let stated = record.velocity_sigma_m_s.unwrap();
        assert!(
            (stated - age_s).abs().max_element() < 1e-4,
            "{stated} {age_s}"
        );
        let stated_m = record.place_sigma_m.unwrap();
        assert!((stated_m - 0.5 * age_s * age_s).abs().max_element() < 1e-4);
        if (age_s - 0.05).abs() < 1e-6 {
            let acceleration = velocity / age_s;
            squares += acceleration * acceleration;
        }
        if start_s.is_none() {
            assert!(velocity.length() < 3e-5, "{velocity}");
        }
    }
    // Sixty numbers: their deviation has a relative error of 1 / sqrt(120), five times which are allowed.
    let found = ((squares.x + squares.y + squares.z) / 60.0).sqrt();
    assert!((found - 1.0).abs() < 5.0 / 120f64.sqrt(), "{found}");
}
