//! Recordings and logs on which earlier versions gave wrong answers, each with its correct result.
//!
//! The files are in `../shared/cases`; a test prints which case it skips where they are missing. Every fault also has a test with its own
//! input, named in the documentation of the case.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{folder_with_recording, root, run};
use tempfile::TempDir;

/// A copy of a case, or `None` with a message.
fn case(name: &str) -> Option<TempDir> {
    let source = root().join("../shared/cases").join(name);
    if !source.exists() {
        println!("skipped: {} not found", source.display());
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let copy = |from: &Path| {
        fs::copy(from, folder.path().join(from.file_name().unwrap())).unwrap();
    };
    if source.is_file() {
        copy(&source);
    } else {
        for entry in fs::read_dir(&source).unwrap() {
            copy(&entry.unwrap().path());
        }
    }
    Some(folder)
}

/// Position and amplitude of the brightest pixel from the record.
fn brightest(folder: &Path, image: &str) -> ([f64; 2], f64) {
    let record = fs::read(folder.join(image).join("image.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    let brightest = &record["brightest"];
    let number = |value: &Value| value.as_f64().unwrap();
    let place = [0, 1].map(|i| number(&brightest["position_m"][i]));
    (place, 10f64.powf(number(&brightest["level_db"]) / 20.0))
}

/// Rows of a track as numbers.
fn rows(folder: &Path, file: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with(['#', 't']));
    rows.map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect()
}

/// Also `track::strays` and tests/recordings.
#[test]
fn cphd_position_of_zero_is_left_out_and_named() {
    let Some(folder) = case("cphd-position-of-zero") else {
        return;
    };
    for file in ["zero.cphd", "jump.cphd"] {
        let ran = run(folder.path(), &format!("info {file}"));
        assert!(
            ran.succeeded().contains("aperture         110 m long"),
            "{ran:?}"
        );
        assert!(
            ran.stderr.contains("warning:") && ran.stderr.contains('7'),
            "{ran:?}"
        );
    }
}

/// Also tests/images/terrain.rs: `nad83_models_are_read_as_wgs_84_with_a_warning`.
#[test]
fn dem_nad83_is_read_with_a_warning() {
    let Some(folder) = case("dem-nad83") else {
        return;
    };
    let ran = run(
        folder.path(),
        "focus flight.cphd --surface dem:nad83.tif --out i",
    );
    ran.succeeded();
    assert!(ran.stderr.contains("NAD83"), "{ran:?}");
}

/// Also tests/recordings/fmcw_samples.rs.
#[test]
fn fmcw_real_and_plain_iq_show_the_target() {
    let Some(folder) = case("fmcw-real-and-plain-iq") else {
        return;
    };
    // The description states no order: that of the sharper image is used.
    for (file, amplitude) in [("iqiq", 3000.0), ("real", 1500.0)] {
        let line =
            format!("focus {file}.toml --grid x=-0.1:0.1:0.002,y=1.1:1.3:0.005,z=0 --out {file}");
        run(folder.path(), &line).succeeded();
        let (place, found) = brightest(folder.path(), file);
        assert!(
            (place[0] - 0.05).hypot(place[1] - 1.2) < 0.003,
            "{file}: {place:?}"
        );
        assert!((found / amplitude - 1.0).abs() < 0.02, "{file}: {found}");
    }
}

/// Also tests/recordings/arrays.rs.
#[test]
fn h5_half_precision_is_read_and_its_sign_asked_for() {
    let Some(folder) = case("h5-half-and-integer-complex") else {
        return;
    };
    // Equally sharp with both signs, so the file must state it.
    run(folder.path(), "info half.h5").failed(1, &["half.h5", "give 'sign'"]);
}

#[test]
fn message_names_both_files_of_one_collection() {
    let Some(folder) = case("message-names-both-files-alike") else {
        return;
    };
    let ran = run(folder.path(), "info first.cphd second.cphd");
    ran.failed(
        1,
        &[
            "first.cphd and second.cphd share 10 pulses",
            "pulse 0 of second.cphd",
        ],
    );
}

/// Also the unit tests of `navigation`'s motion-capture reader.
#[test]
fn motion_capture_euler_angles_are_those_of_the_quaternion() {
    let Some(folder) = case("motion-capture-euler") else {
        return;
    };
    for file in ["euler", "quaternion"] {
        let line = format!("focus {file}.toml --grid x=-0.75:1.25:.02,y=3:5:.02,z=0 --out {file}");
        run(folder.path(), &line).succeeded();
        let (place, found) = brightest(folder.path(), file);
        assert!(
            (place[0] - 0.25).hypot(place[1] - 4.0) < 0.011,
            "{file}: {place:?}"
        );
        assert!((found - 1.0).abs() < 0.02, "{file}: {found}");
    }
}

#[test]
fn nav_equal_times_are_named_and_not_called_damage() {
    let Some(folder) = case("nav-equal-times-called-damage") else {
        return;
    };
    let ran = run(folder.path(), "navigation twice.csv -o t.csv");
    ran.succeeded();
    assert!(ran.stderr.contains("times that do not ascend"), "{ran:?}");
    assert!(!ran.stderr.contains("damaged"), "{ran:?}");
}

#[test]
fn nav_no_checksum_is_read() {
    let Some(folder) = case("nav-no-checksum") else {
        return;
    };
    let ran = run(folder.path(), "navigation plain.nmea");
    assert!(ran.succeeded().contains("8 records"), "{ran:?}");
}

#[test]
fn nav_novatel_abbreviated_is_read() {
    let Some(folder) = case("nav-novatel-abbreviated") else {
        return;
    };
    let ran = run(folder.path(), "navigation abbreviated.asc -o t.csv");
    assert!(ran.succeeded().contains("BESTPOS   5 records"), "{ran:?}");
    // The origin of the frame is the first position; its height above the ellipsoid is 90 - 20 m.
    let text = fs::read_to_string(folder.path().join("t.csv")).unwrap();
    assert!(text.contains("height 70.0"), "{text}");
}

#[test]
fn nav_origin_south_is_taken() {
    let Some(folder) = case("nav-origin-south") else {
        return;
    };
    run(
        folder.path(),
        "navigation south.csv --origin -33.5,151.5,0 -o t.csv",
    )
    .succeeded();
    let rows = rows(folder.path(), "t.csv");
    assert_eq!(rows.len(), 5);
    assert!(
        rows[0][1].hypot(rows[0][2]) < 1e-3 && (rows[0][3] - 100.0).abs() < 1e-3,
        "{rows:?}"
    );
}

#[test]
fn nav_sbet_week_wraps() {
    let Some(folder) = case("nav-sbet-week-wraps") else {
        return;
    };
    run(
        folder.path(),
        "navigation weekend.sbet --week 2400 -o t.csv",
    )
    .succeeded();
    let rows = rows(folder.path(), "t.csv");
    assert_eq!(rows.len(), 10);
    let (first, last) = (&rows[0], &rows[9]);
    assert!((last[0] - first[0] - 4.5).abs() < 1e-6, "{rows:?}");
    assert!((last[1] - first[1] - 7.19).abs() < 0.01, "{rows:?}");
}

#[test]
fn nav_undulation_comes_and_goes() {
    let Some(folder) = case("nav-undulation-comes-and-goes") else {
        return;
    };
    run(folder.path(), "navigation mixed.nmea -o t.csv").succeeded();
    let rows = rows(folder.path(), "t.csv");
    assert!(
        rows.len() == 10 && rows.iter().all(|row| row[3].abs() < 1e-3),
        "{rows:?}"
    );
}

/// A stepped-frequency radar on a road, in the near field: antennas of 40 deg, intra-pulse motion, navigation errors. Errors are relative
/// to the power of the image, which does not depend on the number of clutter's scatterers: few are simulated.
const TRUCK: &str = r#"name = "truck"
seed = 5
[scene]
reference = "0, 25, 0 m"
x = "-20, 20 m"
y = "5, 45 m"
[scene.origin]
latitude = "40.42 deg"
longitude = "-86.92 deg"
height = "190 m"
[[scene.point]]
position = "0, 25, 0 m"
cross_section = "10 m^2"
[[scene.point]]
position = "-10, 10, 0 m"
cross_section = "3 m^2"
[[scene.point]]
position = "10, 40, 0 m"
cross_section = "30 m^2"
[[scene.clutter]]
x = "-20, 20 m"
y = "5, 45 m"
density = 5
sigma0 = "-20 dB"
[radar]
kind = "stepped"
pulses = 800
pri = "0.1 s"
centre = "1.85 GHz"
bandwidth = "300 MHz"
samples = 201
step_time = "0.2 ms"
motion = "true"
[[radar.transmitter]]
boresight = "0, 1, 0"
pattern = "gaussian"
azimuth = "40 deg"
elevation = "60 deg"
[[radar.receiver]]
boresight = "0, 1, 0"
pattern = "gaussian"
azimuth = "40 deg"
elevation = "60 deg"
[radar.noise]
power = "-10 dB"
[platform]
kind = "linear"
position = "0, 0, 2 m"
velocity = "0.4, 0, 0 m/s"
[[platform.perturbation]]
kind = "sway"
rms = "10, 10, 1 cm"
correlation = "8 s"
[navigation]
noise = "1, 1, 1 cm"
drift = "3, 3, 1 cm"
drift_time = "20 s"
fix_rate = "20 Hz"
"#;

/// The image of [`TRUCK`] by default settings is predicted within the default bound of -60 dB, and its sampled pixels are no worse.
fn assert_truck_is_focused(grid: &str) {
    let folder = folder_with_recording("truck", TRUCK);
    let at = folder.path();
    run(at, &format!("focus truck.cphd --out truck{grid}")).succeeded();
    let record = fs::read(at.join("truck/image.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    let resolved = &record["settings"]["resolved"];
    let error_db = |key: &str| resolved[key].as_f64().unwrap();
    let (predicted, sampled) = (error_db("predicted_error_db"), error_db("sampled_error_db"));
    println!("predicted {predicted:.1} dB, sampled {sampled:.1} dB");
    assert!(sampled < predicted && predicted < -60.0, "{resolved}");
}

#[test]
fn truck_is_focused_within_the_default_bound() {
    assert_truck_is_focused(" --grid x=-12:12.05:0.1,y=8:42.1:0.4");
}

#[test]
#[ignore = "takes a minute: run by cargo xtask long"]
fn truck_is_focused_within_the_default_bound_on_its_default_grid() {
    assert_truck_is_focused("");
}

/// Two receivers 0.25 m ahead of and behind one transmitter.
const GMTI: &str = r#"name = "gmti"
seed = 11
[scene]
reference = "0, 0, 0 m"
x = "-60, 60 m"
y = "-60, 60 m"
[[scene.clutter]]
x = "-60, 60 m"
y = "-60, 60 m"
density = 3
sigma0 = "-5 dB"
[[scene.mover]]
kind = "linear"
position = "0, 0, 0 m"
velocity = "0, 1.0, 0 m/s"
cross_section = "5 m^2"
[radar]
kind = "ideal"
pulses = 1040
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 200
[[radar.transmitter]]
offset = "0, 0, 0 m"
[[radar.receiver]]
offset = "0.25, 0, 0 m"
[[radar.receiver]]
offset = "-0.25, 0, 0 m"
[radar.noise]
power = "-10 dB"
[platform]
kind = "linear"
position = "0, -5, 1 km"
velocity = "125, 0, 0 m/s"
"#;

#[test]
fn gmti_has_both_channels_of_its_scenario() {
    let folder = folder_with_recording("gmti", GMTI);
    let at = folder.path();
    let ran = run(at, "info gmti.cphd --json");
    let info: Value = serde_json::from_str(ran.succeeded()).unwrap();
    let channels = info["containers"][0]["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 2);
    // Midpoints of transmitter and receiver: 0.125 m ahead of and behind the transmitter.
    for (channel, (id, offset_m)) in channels.iter().zip([("T1R1", 0.0), ("T1R2", -0.25)]) {
        assert_eq!(channel["id"], id);
        assert_eq!(
            (&channel["vectors"], &channel["samples"]),
            (&1040.into(), &200.into())
        );
        let found_m: Vec<f64> = serde_json::from_value(channel["offset_m"].clone()).unwrap();
        // Positions are Earth-centred float64, to 1 nm.
        for (found_m, expected_m) in found_m.iter().zip([offset_m, 0.0, 0.0]) {
            assert!((found_m - expected_m).abs() < 1e-8, "{id}: {found_m}");
        }
    }
    let centre_hz = channels[0]["centre_hz"].as_f64().unwrap();
    // 200 samples of 150 MHz about 10 GHz: their mean is half a step below.
    assert!(
        (centre_hz - (10e9 - 0.5 * 150e6 / 200.0)).abs() < 1.0,
        "{centre_hz}"
    );
    assert!(info["beam"].is_null(), "{info}");
}

/// Four reflectors alone (mp, mpt), and with a fifth target that is stationary (mpm0) or moves (mpm). Also tests/cli/track.rs.
#[test]
fn mp_mpm_mpm0_and_mpt_give_tracks_of_9_6_m() {
    for (name, movers) in [("mp", 0), ("mpt", 0), ("mpm0", 0), ("mpm", 1)] {
        let Some(folder) = case(&format!("{name}.toml")) else {
            continue;
        };
        let at = folder.path();
        run(at, &format!("simulate {name}.toml -o a.cphd")).succeeded();
        let ran = run(at, "track a.cphd -o track.csv --json");
        let result: Value = serde_json::from_str(ran.succeeded()).unwrap();
        let length_m = result["length_m"].as_f64().unwrap();
        assert!((length_m - 9.615).abs() < 0.02, "{name}: {result}");
        let found = result["movers"].as_array().unwrap();
        assert_eq!(found.len(), movers, "{name}: {result}");
        for mover in found {
            let velocity = [0, 1].map(|i| mover["velocity_m_s"][i].as_f64().unwrap());
            assert!(
                (velocity[0] - 0.3).hypot(velocity[1] - 0.4) < 0.02,
                "{velocity:?}"
            );
        }
    }
}
