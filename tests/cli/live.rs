//! `subap live`, and captures that are watched.

use std::fs;

use serde_json::Value;
use subaperture::Focusing;
use subaperture::focus::exact::Exact;
use subaperture::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture::image::Comparison;
use subaperture::io::npy;
use subaperture::radio::experiment::Experiment;
use subaperture::radio::history::{Capture, Options, Placement};
use subaperture::signal::window::Window;
use subaperture_tests::subap::run;
use tempfile::TempDir;

/// A rail of 2 m, a sweep each 5 cm, and a reflector off its middle.
const SCENE: &str = r#"
seed = 7
[radar]
kind = "ideal"
pulses = 1
pri = "1 s"
centre = "1.4 GHz"
bandwidth = "600 MHz"
samples = 32
[[radar.receiver]]
offset = "0, 0.2, 0 m"
[radar.noise]
power = "-20 dB"
[platform]
kind = "linear"
position = "-1, 0, 0 m"
velocity = "0.25, 0, 0 m/s"
at = "start"
[scene]
reference = "0, 4, 0 m"
[[scene.point]]
position = "0.3, 4.2, 0 m"
"#;

const RAIL: &str = r#"
name = "rail"
[plan]
start = "1.1 GHz"
stop = "1.7 GHz"
steps = 32
dwell = "0.5 ms"
sweeps = 40
[antennas]
transmitter = "0, 0, 0 m"
receiver_1 = "0, 0.2, 0 m"
[device]
kind = "simulated"
scenario = "scene.toml"
loop_delay = "0 ns"
cable_delay = "0 ns"
leakage = 0
[faults]
overflow = 0.02
lost_packet = 0.02
[live]
grid = "x=-1:1.5:0.05,y=3:5.5:0.05"
position = "-1, 0, 0 m"
velocity = "0.25, 0, 0 m/s"
"#;

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    fs::write(folder.path().join("rail.toml"), RAIL).unwrap();
    folder
}

/// The image at the end of a capture is that of its recording: within the bound asked for its error, -50 dB, against the float64 sum over the
/// recording's pulses; and the reflector is where it stands, within 5 cm: noise of -20 dB a sample is below -60 dB after all of them, and moves it
/// by less than a pixel, which is 5 cm.
#[test]
fn a_capture_is_imaged_while_it_runs() {
    let folder = folder();
    let ran = run(
        folder.path(),
        "live rail.toml --out rail --image image --window none --error-db -50 --json",
    );
    let told: Value = serde_json::from_str(ran.succeeded()).unwrap();
    println!("{}\n{}", ran.stderr, told["image"]);
    let sweeps = told["image"]["sweeps"].as_u64().unwrap();
    let elsewhere = ["left_out", "skipped"].map(|key| told["image"][key].as_u64().unwrap());
    // All of the capture fits the queues, so that none is skipped on however slow a machine.
    assert_eq!((sweeps, elsewhere), (40, [0, 0]));
    let at = &told["image"]["brightest"]["position_m"];
    let [x, y] = [0, 1].map(|i| at[i].as_f64().unwrap());
    assert!((x - 0.3).abs() < 0.051 && (y - 4.2).abs() < 0.051, "{at}");
    assert!(folder.path().join("image/live.png").exists());
    let read = Experiment::read(&folder.path().join("rail.toml"), &[]).unwrap();
    let live = read.live.unwrap();
    let capture = Capture::open(&folder.path().join("rail"), Options::default()).unwrap();
    let track = live.way.track().unwrap();
    let grid: ImageGrid = live.grid;
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let extent = Extent {
        x_m: (grid.columns.at(0), grid.columns.at(columns - 1)),
        y_m: (grid.rows.at(0), grid.rows.at(rows - 1)),
    };
    let placement = Placement {
        track: Some(&track),
        antennas: None,
        reference_m: grid.position_m(rows / 2, columns / 2),
        extent: Some(extent),
        frame: SceneFrame::Local,
    };
    let channels = capture.channels(&placement).unwrap();
    let exact = Focusing::new(channels.channel(0), &grid)
        .windows(Window::None, Window::None)
        .by(&Exact)
        .unwrap();
    let formed = npy::read(&folder.path().join("image/live.npy")).unwrap();
    let compared = Comparison::between(&formed, &exact.image).unwrap();
    println!("{compared:?}");
    assert!(
        compared.error_db.is_none_or(|db| db < -50.0),
        "{compared:?}"
    );
}

/// Without a terminal the view is a line now and then; the page's address is told, and a warning where others can reach it.
#[test]
fn a_watched_capture_is_the_same_and_says_who_may_look() {
    let folder = folder();
    let captured = |name: &str, more: &str| {
        let line = format!("capture rail.toml --out {name} --set plan.sweeps=3 {more}");
        let ran = run(folder.path(), &line);
        ran.succeeded();
        let data = folder.path().join(format!("{name}.sigmf-data"));
        (fs::read(data).unwrap(), ran.stderr)
    };
    let (plain, _) = captured("plain", "");
    let (watched, told) = captured("watched", "--live --page");
    assert!(plain == watched && !plain.is_empty());
    assert!(
        told.contains("the page is at http://127.0.0.1:") && !told.contains("warning: --listen"),
        "{told}"
    );
    let (_, told) = captured("open", "--listen 0.0.0.0:0");
    assert!(
        told.contains("warning: --listen 0.0.0.0:") && told.contains("whoever reaches"),
        "{told}"
    );
}

/// What an experiment lacks for an image is said before the radio is opened.
#[test]
fn an_experiment_without_an_image_is_refused() {
    let folder = folder();
    let text = RAIL.split("[live]").next().unwrap();
    fs::write(folder.path().join("rail.toml"), text).unwrap();
    let ran = run(folder.path(), "live rail.toml --out rail");
    assert!(
        ran.code == Some(2) && ran.stderr.contains("[live]"),
        "{ran:?}"
    );
    fs::write(folder.path().join("rail.toml"), RAIL).unwrap();
    let ran = run(
        folder.path(),
        "live rail.toml --out rail --listen 192.0.2.1:80",
    );
    assert!(
        ran.code == Some(1) && ran.stderr.contains("cannot listen at 192.0.2.1:80"),
        "{ran:?}"
    );
    assert!(!folder.path().join("rail.sigmf-data").exists());
}
