//! Captures with a simulated vector network analyser through the command.

mod faults;
mod refusals;
mod runs;

use std::fs;
use std::path::Path;

use subaperture_tests::simulated_vna::{Scene, Target, echo};
use subaperture_tests::subap::{Ran, command};

/// Frequencies of the captures.
const START_HZ: f64 = 2e9;
const STEP_HZ: f64 = 5e6;
const POINTS: usize = 101;
/// Displacement from stop to stop, metres.
const STEP_M: f64 = 0.03;
const STOPS: usize = 41;

/// Two targets within the unambiguous range of 30 m, resolved by 0.3 m in range and `lambda R / (2 L)`, 0.3 m, in cross-range.
const TARGETS: [Target; 2] = [
    Target {
        place_m: [0.25, 6.0, 0.0],
        amplitude: 0.02,
    },
    Target {
        place_m: [-1.5, 9.0, 0.0],
        amplitude: 0.01,
    },
];

/// Both antennas at one place on a rail along x.
fn antennas_m(stop: usize) -> [[f64; 3]; 2] {
    let x = -0.6 + STEP_M * stop as f64;
    [[x, 0.0, 0.0]; 2]
}

/// Echoes at the stop after those recorded in `folder`.
fn scene(folder: &Path) -> Scene {
    let folder = folder.to_owned();
    Scene {
        targets: TARGETS.to_vec(),
        stop: Box::new(move || sweeps(&folder).len()),
        antennas_m,
    }
}

/// Names of the recorded sweeps, in order.
fn sweeps(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with("sweep")).collect();
    names.sort();
    names
}

/// Experiment with quick time-outs. A fault takes one time-out, and a slow machine may add some.
fn experiment(port: u16, sweeps: usize, device: &str, scan: &str) -> String {
    format!(
        r#"name = "Yard"
[plan]
start = "2 GHz"
step = "5 MHz"
steps = {POINTS}
sweeps = {sweeps}
[device]
kind = "vna"
address = "127.0.0.1"
port = {port}
if_bandwidth = "10 kHz"
timeout = "1 s"
pause = "50 ms"
connections = 40
{device}
[scan]
{scan}
"#
    )
}

/// Stops of the rail without a pause.
const AT_ONCE: &str = "mode = \"immediate\"\nfirst = \"-0.6, 0, 0 m\"\nstep = \"30, 0, 0 mm\"\n";

/// Write `vna.toml` and run `capture vna.toml -o scan` with more words.
fn captured(at: &Path, text: &str, more: &str) -> Ran {
    fs::write(at.join("vna.toml"), text).unwrap();
    let line = format!("capture vna.toml -o scan {more}");
    let output = command(at, line.split_whitespace()).output();
    output.unwrap().into()
}

/// Numbers of a file's lines. Two-port lines have 11, 21, 12, 22; one-port lines 11.
fn lines(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with(['!', '#']));
    lines
        .map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect())
        .collect()
}

/// Assert that the files have the echoes of their stops, exactly as measured.
fn assert_echoes(folder: &Path, count: usize) {
    let names = sweeps(folder);
    assert_eq!(names.len(), count);
    for (stop, name) in names.iter().enumerate() {
        let lines = lines(&folder.join(name));
        assert_eq!(lines.len(), POINTS, "{name}");
        for (k, line) in lines.iter().enumerate() {
            let hz = START_HZ + k as f64 * STEP_HZ;
            assert!((line[0] - hz).abs() < 1.0, "{name} {k}: {}", line[0]);
            let expected = echo(&TARGETS, antennas_m(stop), line[0]);
            assert_eq!(line[3..5], expected, "{name} {k}");
            assert!(line[1..3].iter().chain(&line[5..]).all(|part| *part == 0.0));
        }
    }
}
