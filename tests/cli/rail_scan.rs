//! A radio on a rail: captured, converted with its track, focused.

use std::fmt::Write;
use std::fs;

use serde_json::Value;
use subaperture_tests::subap::{command, run};

/// Two points, the nearer the stronger. The receiving antenna is 10 cm above the one that sends, which the attitude does not move.
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

/// Cables as long as the loop, so that ranges count from the antennas.
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

/// Points are found within 5 cm: a fifth of the resolution in range, 25 cm, and a third of that across, some 18 cm, which at 40 dB over the noise
/// errs by millimetres; what motion within a sweep leaves is an eighth of a wavelength at the most.
#[test]
fn a_rail_scan_is_captured_converted_and_focused() {
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
    let told: Value = serde_json::from_str(run(at, convert).succeeded()).unwrap();
    assert_eq!(
        (told["pulses"].as_u64(), told["samples"].as_u64()),
        (Some(46), Some(40))
    );
    for (grid, x_m, y_m) in [
        ("x=-0.5:1.5:0.02,y=4:6:0.02,z=0", 0.4, 5.0),
        ("x=-1.5:0:0.02,y=6:7.5:0.02,z=0", -0.7, 6.5),
    ] {
        let line = format!("focus walk.cphd --grid {grid} --out image --json");
        let told: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
        let place = &told["brightest"]["position_m"];
        let off_m = (place[0].as_f64().unwrap() - x_m).hypot(place[1].as_f64().unwrap() - y_m);
        assert!(off_m < 0.05, "{place}");
    }
    // The scene is where the phases are referred to: geometry, resolution and the default grid are those around 0, 5, 0.
    let told: Value = serde_json::from_str(run(at, "info walk.cphd --json").succeeded()).unwrap();
    assert_eq!(
        told["scene_centre_m"].as_array().unwrap()[1]
            .as_f64()
            .unwrap()
            .round(),
        5.0
    );
    // Transmitter at the rail, receiver 0.2 m aside.
    let slant_m = told["slant_range_m"].as_f64().unwrap();
    assert!((slant_m - 5.0).abs() < 0.15, "{slant_m}");
    // c / (2 B) of 600 MHz is 0.25 m; the sides of 31 degrees' aperture add their projection, so that range resolves less than twice as well.
    let range_m = told["range_resolution_m"].as_f64().unwrap();
    assert!((0.125..0.26).contains(&range_m), "{range_m}");
    // lambda R / (2 L) with 0.214 m, 5 m and 2.7 m.
    let cross_m = told["cross_range_resolution_m"].as_f64().unwrap();
    assert!((0.15..0.25).contains(&cross_m), "{cross_m}");
    let told: Value =
        serde_json::from_str(run(at, "focus walk.cphd --out default --json").succeeded()).unwrap();
    let place = &told["brightest"]["position_m"];
    let near = |x_m: f64, y_m: f64| {
        (place[0].as_f64().unwrap() - x_m).hypot(place[1].as_f64().unwrap() - y_m) < 0.1
    };
    assert!(near(0.4, 5.0) || near(-0.7, 6.5), "{place}");
    // Without a track there is no aperture, which is said.
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
    // Track with another time origin: no sweep lies within it.
    let line = "radio convert walk --track track.csv --zero 100 --reference 0,5,0 -o other.cphd";
    run(at, line).failed(1, &["no sweep lies within the track", "time 0"]);
    // The leakage as the reference wants two receivers where the plan says.
    let line = "capture rail.toml -o two --set plan.reference=leakage";
    run(at, line).failed(1, &["receiver 0's antenna"]);
    let line = "capture rail.toml -o two --set plan.reference=leakage --set device.leakage=20 --set antennas.receiver_0=1,0,0m";
    run(at, line).failed(1, &["two receivers"]);
    assert!(!at.join("two.sigmf-meta").exists());
}
