//! `subap live`, and captures with a live view.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture::Focusing;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture::glam::{DQuat, DVec3, EulerRot};
use subaperture::image::{Comparison, Image};
use subaperture::io::npy;
use subaperture::radio::experiment::Experiment;
use subaperture::radio::history::{Capture, Options, Placement, Track};
use subaperture::signal::window::Window;
use subaperture::track::{Fix, SampledTrack};
use subaperture_tests::subap::run;
use tempfile::TempDir;

/// A rail of 2 m with a sweep every 5 cm, and a reflector off its middle.
pub(super) const SCENE: &str = r#"
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

pub(super) const RAIL: &str = r#"
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

/// The image at the end of a capture equals that of its recording within the requested error, -50 dB, by the float64 sum over the
/// recording's pulses. The reflector is at its position within 5 cm: noise of -20 dB per sample is below -60 dB in the sum and shifts it by
/// less than a pixel of 5 cm.
#[test]
fn capture_is_imaged_while_it_runs() {
    let folder = folder();
    let ran = run(
        folder.path(),
        "live rail.toml --out rail --image image --window none --error-db -50 --json",
    );
    let result: Value = serde_json::from_str(ran.succeeded()).unwrap();
    println!("{}\n{}", ran.stderr, result["image"]);
    let sweeps = result["image"]["sweeps"].as_u64().unwrap();
    let elsewhere = ["left_out", "skipped"].map(|key| result["image"][key].as_u64().unwrap());
    // The whole capture fits the queues, so none is skipped on any machine.
    assert_eq!((sweeps, elsewhere), (40, [0, 0]));
    let at = &result["image"]["brightest"]["position_m"];
    let [x, y] = [0, 1].map(|i| at[i].as_f64().unwrap());
    assert!((x - 0.3).abs() < 0.051 && (y - 4.2).abs() < 0.051, "{at}");
    assert!(folder.path().join("image/image.png").exists());
    // The result is an image product.
    for line in [
        "quality image --json",
        "compare image image/image.npy",
        "picture image -o again.png",
        "info image",
    ] {
        run(folder.path(), line).succeeded();
    }
    let read = Experiment::read(&folder.path().join("rail.toml"), &[]).unwrap();
    let live = read.live.unwrap();
    let capture = Capture::open(&folder.path().join("rail"), Options::default()).unwrap();
    let track = live.motion.track().unwrap();
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
    let formed = npy::read(&folder.path().join("image/image.npy")).unwrap();
    let compared = Comparison::between(&formed, &exact.image).unwrap();
    println!("{compared:?}");
    assert!(
        compared.error_db.is_none_or(|db| db < -50.0),
        "{compared:?}"
    );
}

/// Seven reflectors with sizes such that all echoes are equally strong from the middle of a walk.
const PLACES: [(f64, f64); 7] = [
    (-4.5, 5.0),
    (-2.8, 9.5),
    (-0.5, 7.2),
    (1.5, 12.6),
    (3.4, 8.8),
    (5.2, 13.2),
    (5.6, 4.6),
];

/// 5 m along x at 4 cm/s, with a decimetre of deviation sideways and along, and a heading that varies by 4 degrees.
fn walk() -> Vec<Fix> {
    let fix = |n: u32| {
        let time_s = 0.5 * f64::from(n) - 1.0;
        let sway = |cycles: f64, turns: f64| (TAU * (cycles * time_s / 126.0 + turns)).sin();
        Fix {
            time_s,
            position_m: DVec3::new(
                0.04 * time_s - 2.5 + 0.08 * sway(2.3, 0.0),
                0.1 * sway(1.2, 0.1) + 0.02 * sway(5.1, 0.3),
                0.0,
            ),
            attitude: Some(DQuat::from_rotation_z(
                0.05 * sway(1.7, 0.05) + 0.02 * sway(4.3, 0.4),
            )),
        }
    };
    (0..300).map(fix).collect()
}

/// Write the example `walk` with this trajectory into a folder, with its grid.
fn walking(folder: &Path) {
    let example = |name: &str| {
        let ran = run(folder, &format!("capture --example {name}"));
        ran.succeeded().to_owned()
    };
    let (radar, _) = example("walk-scene")
        .split_once("[platform]")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    let mut scene = radar.replace("0 dB", "6 dB")
        + "[platform]\nkind = \"csv\"\nfile = \"track.csv\"\n[scene]\nreference = \"0, 6, 0 m\"\n";
    for (x, y) in PLACES {
        let square_m = ((x * x + y * y) / 42.25f64).powi(2);
        scene += &format!(
            "[[scene.point]]\nposition = \"{x}, {y}, 0 m\"\ncross_section = \"{square_m} m^2\"\n"
        );
    }
    let mut csv = "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n".to_owned();
    for fix in walk() {
        let (at, attitude) = (fix.position_m, fix.attitude.unwrap());
        let yaw_deg = attitude.to_euler(EulerRot::ZYX).0.to_degrees();
        csv += &format!("{},{},{},0,0,0,{yaw_deg}\n", fix.time_s, at.x, at.y);
    }
    for (name, text) in [
        ("walk.toml", example("walk")),
        ("walk-scene.toml", scene),
        ("track.csv", csv),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
}

/// The brightest pixel within 0.4 m of a position, dB.
fn brightest_db(image: &Image, grid: &ImageGrid, about: DVec3) -> f64 {
    let each = image.pixels.iter().enumerate();
    let near = each.filter(|(i, _)| {
        let at = grid.position_m(i / image.columns, i % image.columns);
        at.distance(about) < 0.4
    });
    20.0 * near
        .map(|(_, z)| f64::from(z.norm()))
        .fold(0.0, f64::max)
        .log10()
}

/// A walk with an unknown trajectory is imaged while it goes on, in the axes that the body had at the start. Every reflector has its level
/// in the image on the true trajectory within 3 dB: measured are 0.2 to 0.6 dB, while the track estimated from the whole recording costs
/// 0.04 dB, because the first positions depend on targets that are not yet certain. Every sweep is imaged. Pixels are a quarter of the resolution in both images.
#[test]
fn walk_is_imaged_while_its_track_is_estimated() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    walking(at);
    let grid = "x=-3:9:0.05,y=3:15:0.05";
    let words = format!(
        "live walk.toml --out walk --image image --window hamming --json --set live.grid={grid}"
    );
    let ran = run(at, &words);
    let result: Value = serde_json::from_str(ran.succeeded()).unwrap();
    println!("{}\n{}", ran.stderr, result["image"]);
    let count = |key: &str| result["image"][key].as_u64().unwrap();
    assert_eq!(["sweeps", "left_out", "skipped"].map(count), [200, 0, 0]);
    let length_m = result["image"]["track"]["length_m"].as_f64().unwrap();
    assert!((4.5..6.0).contains(&length_m), "{length_m}");
    let formed = npy::read(&at.join("image/image.npy")).unwrap();
    let formed_grid: ImageGrid = grid.parse().unwrap();

    let fixes = walk();
    let track = Track {
        poses: Box::new(SampledTrack::new(&fixes).unwrap()),
        span_s: (fixes[0].time_s, fixes[fixes.len() - 1].time_s),
        zero_s: 0.0,
    };
    let capture = Capture::open(&at.join("walk"), Options::default()).unwrap();
    let began = track.pose(capture.response(0, 0).times_s[75]);
    let placement = Placement {
        track: Some(&track),
        antennas: None,
        reference_m: DVec3::new(0.0, 9.0, 0.0),
        extent: Some(Extent {
            x_m: (-6.0, 6.5),
            y_m: (4.0, 14.0),
        }),
        frame: SceneFrame::Local,
    };
    let sum = capture
        .channels(&placement)
        .unwrap()
        .coherent_sum()
        .unwrap();
    let mut most_db = 0f64;
    for (x, y) in PLACES {
        let place = DVec3::new(x, y, 0.0);
        let chip: ImageGrid = format!(
            "x={}:{}:0.05,y={}:{}:0.05",
            x - 0.4,
            x + 0.4,
            y - 0.4,
            y + 0.4
        )
        .parse()
        .unwrap();
        let on_truth = Focusing::new(&sum, &chip)
            .windows(Window::Hamming, Window::None)
            .by(&Backprojection::default())
            .unwrap();
        let true_db = brightest_db(&on_truth.image, &chip, place);
        let local = began.attitude.inverse() * (place - began.position_m);
        let live_db = brightest_db(&formed, &formed_grid, local);
        println!(
            "{place:.1}: {true_db:.2} dB on the true track, {live_db:.2} dB on the estimated one"
        );
        most_db = most_db.max((live_db - true_db).abs());
    }
    assert!(most_db < 3.0, "{most_db}");
    // One receiver gives no direction, and antennas too far apart give ambiguous ones: refused before the capture.
    let refused = |more: &str, words: &[&str]| {
        let ran = run(at, &format!("live walk.toml --out other {more}"));
        assert!(ran.code == Some(1), "{ran:?}");
        for word in words {
            assert!(ran.stderr.contains(word), "no {word}: {}", ran.stderr);
        }
        assert!(!at.join("other.sigmf-data").exists());
    };
    refused(
        "--set plan.reference=loopback",
        &["walk.toml:", "plan.reference is"],
    );
    let wide = fs::read_to_string(at.join("walk-scene.toml")).unwrap();
    fs::write(at.join("wide.toml"), wide.replace("0.307", "0.5")).unwrap();
    refused(
        "--set antennas.receiver_1=0.5,0,0m --set device.scenario=wide.toml",
        &["half a wavelength"],
    );
}

/// The example as printed, without a change.
#[test]
fn every_sweep_of_the_example_walk_is_imaged() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (name, file) in [("walk", "walk.toml"), ("walk-scene", "walk-scene.toml")] {
        let ran = run(at, &format!("capture --example {name}"));
        fs::write(at.join(file), ran.succeeded()).unwrap();
    }
    let ran = run(at, "live walk.toml --out walk --image image --json");
    let result: Value = serde_json::from_str(ran.succeeded()).unwrap();
    let count = |key: &str| result["image"][key].as_u64().unwrap();
    assert_eq!(["sweeps", "left_out", "skipped"].map(count), [200, 0, 0]);
    assert_eq!(result["image"]["track"]["blind"], 0);
}

/// Without a terminal the view prints a line from time to time. The address of the page is printed, with a warning if other machines can
/// reach it.
#[test]
fn live_view_changes_no_sample_and_reports_who_can_connect() {
    let folder = folder();
    let captured = |name: &str, more: &str| {
        let line = format!("capture rail.toml --out {name} --set plan.sweeps=3 {more}");
        let ran = run(folder.path(), &line);
        ran.succeeded();
        let data = folder.path().join(format!("{name}.sigmf-data"));
        (fs::read(data).unwrap(), ran.stderr)
    };
    let (plain, _) = captured("plain", "");
    let (watched, result) = captured("watched", "--live --page");
    assert!(plain == watched && !plain.is_empty());
    assert!(
        result.contains("the page is at http://127.0.0.1:")
            && !result.contains("warning: --listen"),
        "{result}"
    );
    let (_, printed) = captured("open", "--listen 0.0.0.0:0");
    assert!(
        printed.contains("warning: --listen 0.0.0.0:")
            && printed.contains("everyone who can reach"),
        "{printed}"
    );
}

/// Parameters that an experiment lacks for an image are reported before the radio is opened.
#[test]
fn experiment_without_image_settings_is_refused() {
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
