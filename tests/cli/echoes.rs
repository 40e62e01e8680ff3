//! `subap simulate --echoes`: raw echoes focused again against the phase history of the same scenario.
//!
//! Both the phase history and the focused raw echoes come from the same float32 echoes through the same adapter. Their images differ by
//! - positions in a CPHD: Earth-centred float64 of 6.4e6 m, so each coordinate is off by at most half a step of 0.93 nm, a two-way path by
//!   less than 2 sqrt(3) 0.47 nm = 1.6 nm, and with its reference by 3.2 nm. One range for all pulses is met by moving the reference point,
//!   to 20 nm. In phase this is 2 pi path / lambda: -104 dB at 77 GHz, -127 dB at 10 GHz, with one range -107 dB;
//! - the spline between the positions of a sweep, see `io::recording::write`: below 10 nm of 25 cm, -132 dB;
//! - float32 rounding of the samples, 3e-8 of each: -150 dB.
//!
//! So -100 dB bounds all.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use subaperture::image::Comparison;
use subaperture::io::npy;
use subaperture_tests::subap::{Ran, command, listing, run};

const BOUND_DB: f64 = -100.0;

/// Pulses of a side-looking beam with phases referred to one range; the recorded track is wrong.
const STRIPMAP: &str = r#"name = "strip \"one\""
seed = 3

[scene]
reference_range = "900 m"
x = "-12, 12 m"
y = "-8, 8 m"

[scene.origin]
latitude = "47.1 deg"
longitude = "8.3 deg"
height = "420 m"

[[scene.point]]
position = "-7, 3, 0 m"

[[scene.point]]
position = "2, -5, 0 m"
cross_section = "-6 dBsm"

[radar]
kind = "pulsed"
pulses = 96
pri = "5 ms"
centre = "10 GHz"
samples = 256
sample_rate = "180 MHz"
spreading = true

[radar.pulse]
kind = "lfm"
bandwidth = "150 MHz"
duration = "0.5 us"
sweep = "down"

[[radar.transmitter]]
boresight = "0, -1, 0"
pattern = "gaussian"
azimuth = "4 deg"
elevation = "20 deg"

[radar.noise]
power = "-20 dB"

[navigation]
bias = "1, -2, 1 cm"
noise = "1, 1, 1 mm"

[platform]
kind = "linear"
position = "0, 850, 300 m"
velocity = "50, 0, 0 m/s"
"#;

fn image(folder: &Path, input: &str, out: &str) -> subaperture::image::Image {
    run(folder, &format!("focus {input} --out {out} --algorithm bp")).succeeded();
    npy::read(&folder.join(out).join("image.npy")).unwrap()
}

/// Assert that `recording` and `cphd` give the same image.
#[track_caller]
fn same(folder: &Path, recording: &str, cphd: &str) {
    let raw = image(folder, recording, "raw");
    let reference = image(folder, cphd, "reference");
    let error_db = Comparison::between(&raw, &reference)
        .unwrap()
        .error_db
        .unwrap();
    println!("{recording}: {error_db:.1} dB");
    assert!(error_db < BOUND_DB, "{recording}: {error_db} dB");
}

/// Write the scenario in both formats and compare their images.
#[track_caller]
fn round_trip(text: &str, settings: &str) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), text).unwrap();
    let line = format!("simulate scene.toml {settings} -o a.cphd --echoes deep/raw");
    run(at, &line).succeeded();
    same(at, "deep/raw/recording.toml", "a.cphd");
}

fn example(name: &str) -> &'static str {
    subaperture::simulate::scenario::examples::text(name).unwrap()
}

#[test]
fn stripmap_with_chirps_round_trips() {
    round_trip(STRIPMAP, "");
}

#[test]
fn coded_pulses_round_trip() {
    let sweep = "kind = \"lfm\"\nbandwidth = \"150 MHz\"\nduration = \"0.5 us\"\nsweep = \"down\"";
    assert!(STRIPMAP.contains(sweep));
    let code = "kind = \"code\"\ncode = \"barker-13\"\nchip = \"10 ns\"";
    round_trip(
        &STRIPMAP.replace(sweep, code),
        "--set radar.motion=\"true\"",
    );
}

#[test]
fn rail_sweeps_round_trip_with_intra_pulse_motion() {
    round_trip(
        example("rail"),
        "--set radar.pulses=200 --set radar.mixer_delay=20ns",
    );
}

#[test]
fn stepped_carriers_round_trip_with_intra_pulse_motion() {
    round_trip(example("stepped"), "");
}

#[test]
fn ideal_phase_history_round_trips() {
    round_trip(example("stripmap"), "--set radar.pulses=100");
}

#[test]
fn every_antenna_pair_has_a_description() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let second = "[[radar.receiver]]\noffset = \"0.3, 0, 0 m\"\n\n[[radar.receiver]]\n\n[platform]";
    let text = STRIPMAP.replace("[platform]", second).replace(
        "[radar.noise]",
        "[[radar.transmitter]]\noffset = \"0, 0.2, 0 m\"\n\n[radar.noise]",
    );
    fs::write(at.join("scene.toml"), text).unwrap();
    run(at, "simulate scene.toml --echoes raw").succeeded();
    assert!(!at.join("raw/recording.toml").exists());
    run(at, "simulate scene.toml -o a.cphd").succeeded();
    for id in ["T1R1", "T2R1", "T2R2"] {
        same(
            at,
            &format!("raw/recording-{id}.toml"),
            &format!("a.cphd --channel {id}"),
        );
    }
}

#[test]
fn older_recording_is_replaced_and_other_files_stay() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), STRIPMAP).unwrap();
    run(at, "simulate scene.toml --echoes raw --set radar.pulses=32").succeeded();
    fs::write(at.join("raw/notes.txt"), "mine").unwrap();
    run(at, "simulate scene.toml -o a.cphd --echoes raw").succeeded();
    same(at, "raw/recording.toml", "a.cphd");
    assert_eq!(fs::read(at.join("raw/notes.txt")).unwrap(), b"mine");
    assert!(
        listing(at)
            .keys()
            .all(|path| !path.to_string_lossy().contains(".subap-"))
    );
}

#[test]
fn failed_write_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), STRIPMAP).unwrap();
    // A scatterer at the position of a stationary antenna, with spreading loss: an infinite sample.
    let (scene, _) = example("stripmap").split_once("[platform]").unwrap();
    let at_antenna = scene.replace("0, 10, 0 m", "0, 5, 0 km")
        + "[platform]\nkind = \"fixed\"\nposition = \"0, 5, 0 km\"\n";
    fs::write(at.join("broken.toml"), at_antenna).unwrap();
    fs::write(at.join("file"), "no folder").unwrap();
    fs::create_dir_all(at.join("taken/echoes.npy")).unwrap();
    let before = listing(at);
    let refuse = |line: &str, code, part| run(at, line).failed(code, &[part]);
    refuse(
        "simulate scene.toml --echoes file/raw",
        1,
        "expected a folder, but it or a part of its path is a file",
    );
    refuse(
        "simulate scene.toml --echoes taken",
        1,
        "a folder of that name exists",
    );
    refuse(
        "simulate broken.toml --echoes raw",
        1,
        "not a finite number",
    );
    refuse("simulate scene.toml", 2, "--out");
    refuse(
        "simulate --preset table-4-1 -o a.cphd --echoes raw",
        2,
        "--echoes",
    );
    assert_eq!(listing(at), before);
}

#[test]
fn ctrl_c_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), STRIPMAP).unwrap();
    let before = listing(at);
    // A million pulses take minutes.
    let line = "simulate scene.toml --echoes raw --set radar.pulses=1000000 --set radar.pri=5us";
    let mut child = command(at, line.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The staging folder exists once writing has begun.
    let start = Instant::now();
    while listing(at) == before {
        assert!(start.elapsed() < Duration::from_secs(60), "it never began");
        assert!(child.try_wait().unwrap().is_none(), "it ended early");
        std::thread::sleep(Duration::from_millis(20));
    }
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(sent.success());
    let ran: Ran = child.wait_with_output().unwrap().into();
    ran.failed(130, &["interrupted"]);
    assert_eq!(listing(at), before);
}
