//! `subap focus --motion`: a car that brakes, the record of its motion, its use by other commands, and bad files.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use subaperture_tests::subap::{folder_with_recording, run};

/// A car that brakes from 12 m/s to 10.8 m/s in 0.3 s, diagonally to the line of sight.
const SCENE: &str = r#"name = "car"

[scene]
x = "-20, 20 m"
y = "-20, 20 m"

[[scene.mover]]
kind = "profile"
position = "2, -3, 0 m"
velocity = "12, 12, 0 m/s"
pieces = ["0.3 s, -4, -4, 0 m/s^2"]

[radar]
kind = "ideal"
pulses = 600
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 64

[platform]
kind = "linear"
position = "0, -5, 3 km"
velocity = "125, 0, 0 m/s"
"#;

const GRID: &str = "--grid x=-4:8:0.5,y=-9:3:0.5";

/// Displacement of the car along x and y at `t`, metres.
fn moved_m(t: f64) -> f64 {
    match t < 0.3 {
        true => 12.0 * t - 2.0 * t * t,
        false => 3.42 + 10.8 * (t - 0.3),
    }
}

/// File of the car's motion `from` to `to`, hundredths of a second, displaced by `offset` metres per second.
fn write_motion(at: &Path, name: &str, [from, to]: [i32; 2], offset_m_s: f64) {
    let mut text = "time_s,x_m,y_m,z_m\n".to_owned();
    for n in from..=to {
        let t = f64::from(n) / 100.0;
        let xy_m = moved_m(t) + offset_m_s * t;
        writeln!(text, "{t},{xy_m},{xy_m},0").unwrap();
    }
    fs::write(at.join(name), text).unwrap();
}

fn record(at: &Path, name: &str) -> Value {
    let text = fs::read(at.join(name).join("image.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

#[test]
fn braking_car_is_focused_and_its_motion_recorded() {
    let folder = folder_with_recording("s", SCENE);
    let at = folder.path();
    write_motion(at, "car.csv", [-10, 70], 0.0);
    run(
        at,
        &format!("focus s.cphd --motion car.csv -o moving -q {GRID}"),
    )
    .succeeded();
    // The mean velocity over the 0.599 s of the pulses.
    let mean_m_s = moved_m(0.599) / 0.599;
    let wide = "--grid x=-40:40:0.5,y=-9:3:0.5";
    run(
        at,
        &format!("focus s.cphd --velocity {mean_m_s},{mean_m_s} -o mean -q {wide}"),
    )
    .succeeded();

    let moving = record(at, "moving");
    let place_m = &moving["brightest"]["position_m"];
    // The position at the first pulse, to a pixel.
    let off_m = [(0, 2.0), (1, -3.0)].map(|(i, m)| place_m[i].as_f64().unwrap() - m);
    assert!(off_m.iter().all(|m: &f64| m.abs() <= 0.5), "{place_m}");
    let level_db = |record: &Value| record["brightest"]["level_db"].as_f64().unwrap();
    let loss_db = level_db(&moving) - level_db(&record(at, "mean"));
    println!("mean velocity: {loss_db:.2} dB below the motion");
    assert!(loss_db > 3.0, "{loss_db}");

    let given = &moving["settings"]["given"];
    assert_eq!(given["motion"], "car.csv");
    assert_eq!(given["velocity_m_s"], Value::Null);
    let bytes = fs::metadata(at.join("car.csv")).unwrap().len();
    let inputs = moving["inputs"].as_array().unwrap();
    let file = inputs
        .iter()
        .find(|input| input["path"] == "car.csv")
        .unwrap();
    assert_eq!(file["bytes"], json!(bytes));
    assert_eq!(file["crc32"].as_str().map(str::len), Some(8));

    // Chips are formed along the same motion, and only that.
    let quality = "quality moving --at 2,-3 --from s.cphd --json";
    let report: Value = serde_json::from_str(run(at, quality).succeeded()).unwrap();
    let place_m = &report["points"][0]["response"]["position_m"];
    let off_m = [(0, 2.0), (1, -3.0)].map(|(i, m)| place_m[i].as_f64().unwrap() - m);
    // A tenth of the range resolution, 1 m; the error of interpolation is far below.
    assert!(off_m.iter().all(|m: &f64| m.abs() <= 0.1), "{place_m}");
    write_motion(at, "car.csv", [-10, 70], 0.1);
    run(at, quality).failed(1, &["car.csv", "another motion"]);
    fs::remove_file(at.join("car.csv")).unwrap();
    run(at, quality).failed(1, &["--from", "car.csv"]);
}

#[test]
fn tiles_and_jobs_notice_another_motion() {
    let folder = folder_with_recording("s", SCENE);
    let at = folder.path();
    write_motion(at, "car.csv", [-10, 70], 0.0);
    write_motion(at, "other.csv", [-10, 70], 0.1);
    let line = |motion: &str| format!("focus s.cphd --motion {motion} -q -o tiles {GRID} --tiled");
    run(at, &line("car.csv")).succeeded();
    run(at, &format!("{} --resume", line("car.csv"))).succeeded();
    run(at, &format!("{} --resume", line("other.csv")))
        .failed(1, &["expected tiles of the same plan"]);

    let job = "[input]\nfiles = \"../s.cphd\"\n[grid]\npixels = \"x=-4:8:0.5,y=-9:3:0.5\"\n[former]\nmotion = \"../car.csv\"\n\
               [check]\npixels = 0\n[quality]\npoints = 0\n";
    fs::create_dir(at.join("jobs")).unwrap();
    fs::write(at.join("jobs/job.toml"), job).unwrap();
    run(at, "run jobs/job.toml").succeeded();
    let up_to_date = || {
        let said = run(at, "run jobs/job.toml").succeeded().to_owned();
        let focus = said.lines().find(|line| line.starts_with("focus"));
        focus
            .unwrap_or_else(|| panic!("{said}"))
            .contains("up to date")
    };
    assert!(up_to_date());
    fs::copy(at.join("other.csv"), at.join("car.csv")).unwrap();
    assert!(!up_to_date());
    let both = job.replace("motion =", "velocity = \"1, 2, 0 m/s\"\nmotion =");
    fs::write(at.join("jobs/job.toml"), both).unwrap();
    run(at, "run jobs/job.toml").failed(1, &["give either velocity or motion"]);
}

#[test]
fn bad_motion_is_refused_with_file_and_line() {
    let folder = folder_with_recording("s", SCENE);
    let at = folder.path();
    let header = "time_s,x_m,y_m,z_m\n";
    for (text, parts) in [
        (
            format!("{header}0,0,0,0\n1,1,0,0\n0.5,2,0,0\n"),
            ["line 4", "expected a time after 1 s"],
        ),
        (
            format!("{header}0,0,0,0\n"),
            ["line 2", "expected at least two positions, found 1"],
        ),
        (
            format!("{header}0,0,0,0\n1,NaN,0,0\n"),
            ["line 3", "x_m: expected a number"],
        ),
        (
            "time_s,x_m,y_m\n0,0,0\n1,0,0\n".to_owned(),
            ["line 1", "column 'z_m' is missing"],
        ),
        (
            format!("{header}0.1,0,0,0\n1,1,0,0\n"),
            ["from 0 s to 0.599 s", "found 0.1 s to 1 s"],
        ),
    ] {
        fs::write(at.join("bad.csv"), text).unwrap();
        let ran = run(at, &format!("focus s.cphd --motion bad.csv -o o {GRID}"));
        ran.failed(1, &["bad.csv", parts[0], parts[1]]);
    }
    let gone = format!("focus s.cphd --motion gone.csv -o o {GRID}");
    run(at, &gone).failed(1, &["gone.csv"]);
    let both = format!("focus s.cphd --motion bad.csv --velocity 1,2 -o o {GRID}");
    run(at, &both).failed(2, &["--motion", "--velocity"]);
    run(at, "focus --from-maps m --motion bad.csv -o o").failed(2, &["--from-maps", "--motion"]);
    assert!(!at.join("o").exists());
}
