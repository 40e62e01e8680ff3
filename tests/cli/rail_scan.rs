//! A radio on a rail: capture, conversion with its track, image.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{command, run};

/// Two points, the nearer one stronger. The receiving antenna is 10 cm above the transmitting one, and is not moved by the attitude.
const SCENE: &str = r#"
    seed = 3
    [radar]
    kind = "ideal"
    pulses = 1
    pri = "1 s"
    centre = "1.4 GHz"
    bandwidth = "600 MHz"
    samples = 40
    spreading = true
    [[radar.receiver]]
    offset = "0, 0, 0.1 m"
    [radar.noise]
    power = "-20 dB"
    [platform]
    kind = "rail"
    from = "-1.5, 0, 0 m"
    to = "1.5, 0, 0 m"
    speed = "0.3 m/s"
    [scene]
    reference = "0, 5, 0 m"
    [[scene.point]]
    position = "0.4, 5, 0 m"
    cross_section = "1 m^2"
    [[scene.point]]
    position = "-0.7, 6.5, 0 m"
    cross_section = "1 m^2"
"#;

/// Cables as long as the loopback, so that ranges count from the antennas.
const EXPERIMENT: &str = r#"
    [plan]
    start = "1.1 GHz"
    stop = "1.7 GHz"
    steps = 40
    dwell = "0.2 ms"
    sweeps = 46
    [antennas]
    transmitter = "0, 0, 0 m"
    receiver_1 = "0, 0, 10 cm"
    [device]
    kind = "simulated"
    scenario = "scene.toml"
    loop_delay = "20 ns"
    cable_delay = "20 ns"
    leakage = 0
"#;

/// Record among the files of a printed result.
fn record(at: &Path, result: &Value) -> Value {
    let mut files = result["files"].as_array().unwrap().iter();
    let file = files.find(|file| file["kind"] == "record").unwrap();
    let text = fs::read(at.join(file["path"].as_str().unwrap())).unwrap();
    serde_json::from_slice(&text).unwrap()
}

/// Points are within 5 cm of their positions: a fifth of the range resolution, 25 cm, and a third of the cross-range one, some 18 cm, which
/// at 40 dB over the noise has errors of millimetres. Motion within a sweep is at most an eighth of a wavelength.
#[test]
fn rail_scan_is_captured_converted_and_focused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), SCENE).unwrap();
    fs::write(at.join("rail.toml"), EXPERIMENT).unwrap();
    let mut track = "time_s,x_m,y_m,z_m\n".to_owned();
    for half in 0..=20 {
        let time_s = 0.5 * f64::from(half);
        writeln!(track, "{time_s},{},0,0", -1.5 + 0.3 * time_s).unwrap();
    }
    fs::write(at.join("track.csv"), track).unwrap();
    run(at, "capture rail.toml -o walk").succeeded();
    let convert = "radio convert walk --track track.csv --reference 0,5,0 -o walk.cphd --json";
    let result: Value = serde_json::from_str(run(at, convert).succeeded()).unwrap();
    assert_eq!(
        (result["pulses"].as_u64(), result["samples"].as_u64()),
        (Some(46), Some(40))
    );
    for (grid, x_m, y_m) in [
        ("x=-0.5:1.5:0.02,y=4:6:0.02,z=0", 0.4, 5.0),
        ("x=-1.5:0:0.02,y=6:7.5:0.02,z=0", -0.7, 6.5),
    ] {
        let line = format!("focus walk.cphd --grid {grid} --out image --json");
        let result: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
        let place = &record(at, &result)["brightest"]["position_m"];
        let off_m = (place[0].as_f64().unwrap() - x_m).hypot(place[1].as_f64().unwrap() - y_m);
        assert!(off_m < 0.05, "{place}");
    }
    // Phases are referred to the scene: geometry, resolution and default grid are those around 0, 5, 0.
    let result: Value = serde_json::from_str(run(at, "info walk.cphd --json").succeeded()).unwrap();
    assert_eq!(
        result["scene_centre_m"].as_array().unwrap()[1]
            .as_f64()
            .unwrap()
            .round(),
        5.0
    );
    // Transmitter at the rail, receiver 0.2 m aside.
    let slant_m = result["slant_range_m"].as_f64().unwrap();
    assert!((slant_m - 5.0).abs() < 0.15, "{slant_m}");
    // c / (2 B) of 600 MHz is 0.25 m; the ends of an aperture of 31 degrees add their projection, so the extent in range is larger, by less
    // than a factor of two.
    let range_m = result["range_resolution_m"].as_f64().unwrap();
    assert!((0.125..0.26).contains(&range_m), "{range_m}");
    // lambda R / (2 L) with 0.214 m, 5 m and 2.7 m.
    let cross_m = result["cross_range_resolution_m"].as_f64().unwrap();
    assert!((0.15..0.25).contains(&cross_m), "{cross_m}");
    let result: Value =
        serde_json::from_str(run(at, "focus walk.cphd --out default --json").succeeded()).unwrap();
    let place = &record(at, &result)["brightest"]["position_m"];
    let near = |x_m: f64, y_m: f64| {
        (place[0].as_f64().unwrap() - x_m).hypot(place[1].as_f64().unwrap() - y_m) < 0.1
    };
    assert!(near(0.4, 5.0) || near(-0.7, 6.5), "{place}");
    // Without a track there is no aperture, and the output states this.
    let ran = command(
        at,
        "radio convert walk --reference 0,5,0 -o standing.cphd".split(' '),
    )
    .output()
    .unwrap();
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(
        ran.status.success()
            && said.contains("warning: no --track")
            && said.contains("no aperture"),
        "{said}"
    );
    // A track with another time origin: no sweep lies within it.
    let line = "radio convert walk --track track.csv --zero 100 --reference 0,5,0 -o other.cphd";
    run(at, line).failed(1, &["no sweep lies within the track", "time 0"]);
    // The leakage as reference needs two receivers where the plan names one.
    let line = "capture rail.toml -o two --set plan.reference=leakage";
    run(at, line).failed(1, &["receiver 0's antenna"]);
    let line = "capture rail.toml -o two --set plan.reference=leakage --set device.leakage=20 --set antennas.receiver_0=1,0,0m";
    run(at, line).failed(1, &["two receivers"]);
    assert!(!at.join("two.sigmf-meta").exists());
}
