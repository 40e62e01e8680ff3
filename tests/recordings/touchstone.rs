//! A rail scan of a vector network analyser in Touchstone files, with positions, delays and numbers by formulas of this file.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::geometry::ImageGrid;
use subaperture::io::open::{Options, open};
use subaperture::io::recording::RecordingFile;
use subaperture::prelude::Focusing;

const C: f64 = 299_792_458.0;
const STOPS: usize = 61;
const COUNT: usize = 101;
const START_HZ: f64 = 1.7e9;
const STEP_HZ: f64 = 3e6;
const TARGET_M: DVec3 = DVec3::new(0.4, 12.0, 0.0);

/// Ports at the ends of a bar of 0.3 m on the rail.
fn antennas_m(stop: usize) -> [DVec3; 2] {
    let x = 0.04 * (stop as f64 - 30.0);
    [
        DVec3::new(x - 0.15, 0.0, 0.0),
        DVec3::new(x + 0.15, 0.0, 0.0),
    ]
}

fn s21(stop: usize, k: usize) -> Complex64 {
    let [from, to] = antennas_m(stop);
    let path_m = TARGET_M.distance(from) + TARGET_M.distance(to);
    let hz = START_HZ + k as f64 * STEP_HZ;
    Complex64::from_polar(0.02, -TAU * hz * path_m / C)
}

/// Write the scan. Files differ in unit and format, as those of different analysers do.
fn write(folder: &Path) {
    for stop in 0..STOPS {
        let mut text = "! Analyser, 2026\n".to_owned();
        text += ["# GHz S RI R 50\n", "# MHZ S DB R 50\n", "# Hz S MA R 50\n"][stop % 3];
        for k in 0..COUNT {
            let hz = START_HZ + k as f64 * STEP_HZ;
            let z = s21(stop, k);
            let degrees = z.arg().to_degrees();
            let (unit, pair) = match stop % 3 {
                0 => (1e9, format!("{:.9} {:.9}", z.re, z.im)),
                1 => (1e6, format!("{:.7} {degrees:.7}", 20.0 * z.norm().log10())),
                _ => (1.0, format!("{:.9} {degrees:.7}", z.norm())),
            };
            let (mine, other) = ("0.5 0.1", "0.25 -0.2");
            let _ = writeln!(text, "{:.9}\t{mine} {pair} {pair} {other}", hz / unit);
        }
        std::fs::write(folder.join(format!("stop{stop:02}.s2p")), text).unwrap();
    }
}

fn description(recording: &str, radar: &str) -> String {
    format!(
        r#"[recording]
format = "touchstone"
file = "stop{{00..60}}.s2p"
{recording}
[radar]
kind = "stepped"
pri = "1 s"
{radar}
[[radar.transmitter]]
offset = "-0.15, 0, 0 m"
[[radar.receiver]]
offset = "0.15, 0, 0 m"
[platform]
kind = "linear"
position = "0, 0, 0 m"
velocity = "0.04, 0, 0 m/s"
"#
    )
}

#[test]
fn rail_scan_of_touchstone_files_has_target_in_place() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let path = folder.path().join("scan.toml");
    std::fs::write(&path, description("", "")).unwrap();
    let history = open(&path, &Options::default()).unwrap();
    let collection = history.collection();
    assert_eq!(
        (collection.pulses.len(), collection.num_samples),
        (STOPS, COUNT)
    );
    let mut samples = vec![Complex32::ZERO; STOPS * COUNT];
    history.read(0..STOPS, &mut samples).unwrap();
    for (stop, pulse) in collection.pulses.iter().enumerate() {
        let [from, to] = antennas_m(stop);
        assert!(pulse.transmitter_m.distance(from) < 1e-9 && pulse.receiver_m.distance(to) < 1e-9);
        for k in 0..COUNT {
            let hz = pulse.frequency_hz(k);
            assert!((hz - START_HZ - k as f64 * STEP_HZ).abs() < 1e-3, "{hz}");
            // Phases are referred to the reference path.
            let turned = Complex64::cis(TAU * hz * pulse.reference_path_m / C);
            let expected = s21(stop, k) * turned;
            let z = samples[stop * COUNT + k];
            let off = Complex64::new(z.re.into(), z.im.into()) - expected;
            // Nine digits of 0.02 and seven of an angle, and float32.
            assert!(off.norm() < 1e-8, "{stop} {k}: {off}");
        }
    }
    let grid: ImageGrid = "x=-0.6:1.4:0.05,y=11:13:0.05".parse().unwrap();
    let image = Focusing::new(&*history, &grid)
        .by(&Backprojection::default())
        .unwrap();
    let brightest = image.image.pixels.iter().enumerate();
    let (i, level) = brightest
        .map(|(i, z)| (i, z.norm()))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap();
    let place_m = grid.position_m(i / grid.columns.count, i % grid.columns.count);
    assert!(place_m.distance(TARGET_M) < 0.026, "{place_m}");
    assert!((level - 0.02).abs() < 2e-4, "{level}");
}

#[test]
fn unsuitable_touchstone_recordings_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let refused = |text: String| {
        let file = RecordingFile::new("scan.toml", text, folder.path());
        match file.history(1 << 28) {
            Ok(_) => panic!("taken"),
            Err(error) => error.to_string(),
        }
    };
    for (recording, radar, part) in [
        (
            "parameter = \"s31\"",
            "",
            "expected a parameter of 2 ports, found s31",
        ),
        ("parameter = \"forward\"", "", "such as \"s21\""),
        ("receivers = 2", "", "one sweep of one receiver"),
        ("", "step = \"3.1 MHz\"", "expected 3000000"),
        ("", "start = \"1.6 GHz\"", "expected 1700000000"),
    ] {
        let message = refused(description(recording, radar));
        assert!(message.contains(part), "{part}: {message}");
    }
    // Keys that agree with the files.
    let text = description(
        "parameter = \"S21\"",
        "start = \"1.7 GHz\"\nstep = \"3 MHz\"",
    );
    let file = RecordingFile::new("scan.toml", text, folder.path());
    assert!(file.history(1 << 28).is_ok());
    let path = folder.path().join("stop08.s2p");
    let whole = std::fs::read_to_string(&path).unwrap();
    for (text, part) in [
        (
            whole.replace("1709000000", "1709500000"),
            "expected the frequencies of the first file",
        ),
        (
            whole
                .lines()
                .take(40)
                .map(|line| format!("{line}\n"))
                .collect(),
            "expected 101 frequencies",
        ),
        (
            whole.replace(" S MA", " Z MA"),
            "line 2: expected scattering parameters",
        ),
    ] {
        assert_ne!(text, whole);
        std::fs::write(&path, text).unwrap();
        let message = refused(description("", ""));
        assert!(
            message.contains("stop08.s2p") && message.contains(part),
            "{part}: {message}"
        );
    }
}
