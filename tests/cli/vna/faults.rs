//! A capture under every fault of analyser and connection.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use num_complex::Complex64;
use serde_json::Value;
use subaperture_tests::simulated_vna::{Family, Fault, Options, SimulatedVna};
use subaperture_tests::subap::run;
use tempfile::TempDir;

use super::{
    AT_ONCE, POINTS, START_HZ, STEP_HZ, STOPS, TARGETS, antennas_m, assert_echoes, captured, echo,
    experiment, scene,
};

fn errors(count: usize, code: i32, text: &str) -> Fault {
    Fault::Errors((0..count).map(|_| (code, text.to_owned())).collect())
}

/// Faults with the kind and a part of the text that the record must have, and the least number of entries.
fn every_fault() -> Vec<(Fault, &'static str, &'static str, u64)> {
    let instead = |text: &[u8]| Fault::Instead(text.to_vec());
    vec![
        (Fault::CloseBefore, "closed", "closed the connection", 1),
        (Fault::CloseWithin, "closed", "block ended after", 1),
        (Fault::CloseAfter, "closed", "SENS1:X?", 1),
        (
            Fault::Late(Duration::from_millis(1300)),
            "timeout",
            "CALC1:DATA? SDATA: no answer",
            1,
        ),
        (Fault::Truncated, "truncated", "block ended after", 1),
        (
            Fault::WrongLength(-8),
            "malformed",
            "stated length is wrong",
            1,
        ),
        (Fault::WrongLength(16), "truncated", "block ended after", 1),
        (
            Fault::WrongLength(-3),
            "malformed",
            "stated length is wrong",
            1,
        ),
        (
            Fault::Points(-1),
            "points",
            "expected 101 complex values, found 100",
            1,
        ),
        (Fault::Points(40), "points", "found 141", 1),
        (
            Fault::Value(f64::NAN),
            "not-finite",
            "found NaN at frequency 50",
            1,
        ),
        (Fault::Value(f64::INFINITY), "not-finite", "found inf", 1),
        (
            errors(1, -113, "Undefined header"),
            "instrument",
            "error -113, Undefined header",
            1,
        ),
        (
            errors(3, -222, "Data out of range"),
            "instrument",
            "error -222",
            3,
        ),
        (
            errors(14, -410, "Query INTERRUPTED"),
            "instrument",
            "error -350, Queue overflow",
            1,
        ),
        (Fault::NeverComplete, "timeout", "*OPC?: no answer", 1),
        (
            Fault::Completion("\u{7}@junk\n+1".to_owned()),
            "malformed",
            "@junk",
            1,
        ),
        (
            Fault::Completion("0".to_owned()),
            "malformed",
            "expected 1, found '0'",
            1,
        ),
        (
            Fault::OtherByteOrder,
            "byte-order",
            "found the other one",
            1,
        ),
        (
            Fault::OtherFrequencies,
            "frequencies",
            "found 2005000000 Hz",
            1,
        ),
        (
            Fault::Refuse(Duration::from_millis(400)),
            "unreachable",
            "cannot connect to 127.0.0.1",
            1,
        ),
        (instead(b"\n"), "malformed", "an empty answer", 1),
        (instead(b"NO DATA\n"), "malformed", "'NO DATA'", 1),
        (instead(b"#9999999999"), "too-long", "found 999999999", 1),
        (instead(b"#0"), "malformed", "expected a block", 1),
        (instead(b"#3x16"), "malformed", "'x16'", 1),
        (Fault::Hold, "timeout", "*OPC?: no answer", 1),
        (
            Fault::Queue("No error".to_owned()),
            "malformed",
            "an error code",
            1,
        ),
    ]
}

/// Value at a place of the image by its definition: the mean over pulses and frequencies of the echoes, with the phase of the place removed.
fn image_value(place_m: [f64; 3]) -> Complex64 {
    let mut sum = Complex64::ZERO;
    for stop in 0..STOPS {
        for k in 0..POINTS {
            let hz = START_HZ + k as f64 * STEP_HZ;
            let [re, im] = echo(&TARGETS, antennas_m(stop), hz);
            let unit = super::Target {
                place_m,
                amplitude: 1.0,
            };
            let [unit_re, unit_im] = echo(&[unit], antennas_m(stop), hz);
            sum += Complex64::new(re, im) * Complex64::new(unit_re, -unit_im);
        }
    }
    sum / (STOPS * POINTS) as f64
}

/// Brightest position of the image over a grid, and its magnitude.
fn brightest(at: &Path, grid: &str) -> ([f64; 2], f64) {
    let line = format!(
        "focus scan/recording.toml --grid {grid} --window none --algorithm bp --out image --force --json"
    );
    let result: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
    let files = result["files"].as_array().unwrap();
    let file = files.iter().find(|file| file["kind"] == "record").unwrap();
    let text = fs::read(at.join(file["path"].as_str().unwrap())).unwrap();
    let record: Value = serde_json::from_slice(&text).unwrap();
    let place = &record["brightest"]["position_m"];
    let image = subaperture::io::npy::read(&at.join("image/image.npy")).unwrap();
    let level = image.pixels.iter().map(|z| z.norm()).fold(0.0, f32::max);
    ([0, 1].map(|i| place[i].as_f64().unwrap()), f64::from(level))
}

#[test]
fn capture_under_every_fault_loses_no_sweep_and_records_each_fault() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let faults = every_fault();
    assert!(faults.len() >= 20 && faults.len() < STOPS);
    let mut options = Options::new(Family::Pna, scene(&at.join("scan")));
    // Every fault is followed by a sweep without one.
    options.faults = (0..)
        .zip(&faults)
        .map(|(i, (fault, ..))| (2 * i + 1, fault.clone()))
        .collect();
    let analyser = SimulatedVna::start(options);
    let ran = captured(at, &experiment(analyser.port, STOPS, "", AT_ONCE), "--json");
    let result: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(result["sweeps"].as_u64(), Some(STOPS as u64));
    ran.reports("warning: faults of the analyser");
    let scan = at.join("scan");
    assert_echoes(&scan, STOPS);
    let record = fs::read(scan.join("capture.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    assert_eq!(record["state"], "done");
    let entries = record["faults"].as_array().unwrap();
    let mut least: BTreeMap<&str, u64> = BTreeMap::new();
    for (fault, kind, part, count) in &faults {
        *least.entry(kind).or_default() += count;
        let has = |entry: &&Value| {
            entry["kind"] == *kind && entry["message"].as_str().unwrap().contains(part)
        };
        let found = entries.iter().filter(has).count() as u64;
        assert!(found >= *count, "{fault:?}: {found} in {entries:#?}");
    }
    // A slow machine may add time-outs.
    for (kind, least) in least {
        let counted = record["fault_counts"][kind].as_u64().unwrap();
        let listed = entries.iter().filter(|entry| entry["kind"] == kind).count();
        assert!(
            counted >= least && counted == listed as u64,
            "{kind}: {counted}"
        );
        assert_eq!(result["fault_counts"][kind].as_u64(), Some(counted));
    }
    // The nearer target, and the farther one, at pixels of 2 cm.
    for (target, grid) in [
        (TARGETS[0], "x=-0.55:1.05:0.02,y=5.4:6.6:0.02"),
        (TARGETS[1], "x=-2.1:-0.9:0.02,y=8.4:9.6:0.02"),
    ] {
        let ([x, y], level) = brightest(at, grid);
        let [target_x, target_y, _] = target.place_m;
        let expected = image_value([x, y, 0.0]).norm();
        // Float32 and the former's error bound of -60 dB relative to the brightest.
        assert!((level / expected - 1.0).abs() < 0.003, "{level} {expected}");
        // A third of the resolution, by the sidelobes of the other target.
        assert!((x - target_x).hypot(y - target_y) < 0.1, "{x} {y}");
        assert!((level / target.amplitude - 1.0).abs() < 0.1, "{level}");
    }
    let info = run(at, "info scan/recording.toml");
    assert!(info.succeeded().contains("41"), "{info:?}");
}

#[test]
fn sweep_that_fails_after_all_retries_ends_the_capture_with_its_fault() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let mut options = Options::new(Family::Pna, scene(&at.join("scan")));
    options.faults = (3..6).map(|sweep| (sweep, Fault::Points(-2))).collect();
    let analyser = SimulatedVna::start(options);
    let text = experiment(analyser.port, 10, "retries = 2", AT_ONCE);
    let ran = captured(at, &text, "");
    ran.failed(
        1,
        &[
            "sweep 3 failed 3 times",
            "expected 101 complex values, found 99",
            "the 3 sweeps captured so far are in scan",
        ],
    );
    assert_echoes(&at.join("scan"), 3);
    let record = fs::read_to_string(at.join("scan/capture.json")).unwrap();
    assert!(record.contains("\"failed\"") && record.contains("\"points\": 3"));
    run(at, "info scan/recording.toml").succeeded();
    // The same command continues.
    captured(at, &text, "").succeeded();
    assert_echoes(&at.join("scan"), 10);
}
