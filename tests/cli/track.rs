//! `subap track`, and images on the track that it wrote.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::run;

/// A radar of the L band with two receivers, on a way that is recorded badly.
const WALK: &str = r#"name = "walk"

[scene]
reference = "0, 8, 0 m"
x = "-6, 6 m"
y = "4, 12 m"

[[scene.point]]
position = "-4, 6, 0 m"
[[scene.point]]
position = "-1.2, 9.4, 0 m"
[[scene.point]]
position = "1.9, 7.1, 0 m"
[[scene.point]]
position = "4.6, 10.2, 0 m"

[radar]
kind = "ideal"
pulses = 160
pri = "25 ms"
centre = "1.4 GHz"
bandwidth = "604 MHz"
samples = 151

[[radar.transmitter]]

[[radar.receiver]]
offset = "0.2, 0, 0 m"
[[radar.receiver]]
offset = "0.307, 0, 0 m"

[radar.noise]
power = "-15 dB"

[platform]
kind = "linear"
position = "-2, 0, 0 m"
velocity = "1, 0, 0 m/s"

[[platform.perturbation]]
kind = "vibration"
amplitude = "0, 6, 0 cm"
frequency = "0.4 Hz"

[navigation]                   # what is recorded wanders by decimetres
drift = "8, 8, 0 cm"
drift_time = "1 s"
fix_rate = "40 Hz"

"#;

fn peak_db(folder: &Path, image: &str) -> f64 {
    let text = fs::read(folder.join(image).join("image.json")).unwrap();
    let record: Value = serde_json::from_slice(&text).unwrap();
    record["brightest"]["level_db"].as_f64().unwrap()
}

#[test]
fn a_track_is_written_and_images_are_focused_on_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    run(at, "track walk.cphd -o track.csv -v").succeeded();
    let text = fs::read_to_string(at.join("track.csv")).unwrap();
    assert_eq!(text.lines().count(), 162);
    assert!(at.join("track.png").exists());
    // Again, over its own files; as JSON.
    let told = run(at, "track walk.cphd -o track.csv --json");
    let told: Value = serde_json::from_str(told.succeeded()).unwrap();
    assert_eq!(told["schema"], "subaperture-track");
    let length_m = told["length_m"].as_f64().unwrap();
    println!("{told}");
    assert!((length_m - 4.0).abs() < 0.3, "{length_m}");
    assert_eq!(told["targets"].as_array().unwrap().len(), 4);
    let grid = "--grid x=-6:6:0.04,y=4:12:0.04 --channels all";
    run(at, &format!("focus walk.cphd {grid} --out recorded")).succeeded();
    run(
        at,
        &format!("focus walk.cphd {grid} --track track.csv --out found"),
    )
    .succeeded();
    let [recorded, found] = ["recorded", "found"].map(|image| peak_db(at, image));
    println!("recorded {recorded:.2} dB, found {found:.2} dB");
    // A unit scatterer reads 1 where the track is right.
    assert!(found > -0.7, "{found}");
    let record = fs::read_to_string(at.join("found/image.json")).unwrap();
    assert!(record.contains("track.csv"));
}

#[test]
fn what_tells_no_track_says_why_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    let simulate = "simulate walk.toml -o walk.cphd --set radar.pulses=40";
    run(at, simulate).succeeded();
    let track = |more: &str| run(at, &format!("track walk.cphd -o track.csv {more}"));
    track("--channels T1R1").failed(1, &["two receivers"]);
    track("--range 20m:30m").failed(1, &["nothing is seen", "--range"]);
    track("--range 10.5m:14m").failed(1, &["at a time at the most", "its ranges can be trusted"]);
    track("--range 7m").failed(2, &["ascending ranges"]);
    assert!(!at.join("track.csv").exists());
    fs::write(
        at.join("far.csv"),
        "time_s,x_m,y_m,z_m\n100,0,0,0\n200,1,0,0\n",
    )
    .unwrap();
    run(at, "focus walk.cphd --track far.csv --out image")
        .failed(1, &["no pulse is within", "far.csv"]);
}
