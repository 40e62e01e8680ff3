//! Refused captures with their texts, and runs without an analyser.

use std::fs;
use std::net::TcpListener;

use serde_json::Value;
use subaperture_tests::simulated_vna::{Family, Options, SimulatedVna};
use subaperture_tests::subap::{command, listing, run};
use tempfile::TempDir;

use super::{AT_ONCE, captured, experiment, scene};

#[test]
fn settings_that_the_analyser_does_not_have_are_refused_with_both_values() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let change = |change: fn(&mut Options)| {
        let mut options = Options::new(Family::Znb, scene(&at.join("scan")));
        change(&mut options);
        options
    };
    for (options, device, parts) in [
        (
            change(|o| o.most_power_dbm = -13.5),
            "",
            vec!["device.power: expected -10 dBm", "has set -13.5 dBm"],
        ),
        (
            change(|o| o.most_bandwidth_hz = 3e3),
            "",
            vec!["device.if_bandwidth: expected 10000 Hz", "has set 3000 Hz"],
        ),
        (
            change(|o| o.off_hz = 1e6),
            "",
            vec![
                "plan.start",
                "expected 2000000000 Hz",
                "found 2001000000 Hz",
            ],
        ),
        (
            change(|o| "ACME,VNA-1,0,1.0".clone_into(&mut o.identity)),
            "",
            vec!["found 'ACME,VNA-1,0,1.0'", "device.dialect"],
        ),
        (
            change(|_| ()),
            "dialect = \"copper-mountain\"",
            vec!["the settings are refused", "error -113, Undefined header"],
        ),
    ] {
        let analyser = SimulatedVna::start(options);
        let text = experiment(analyser.port, 3, device, AT_ONCE);
        captured(at, &text, "").failed(1, &parts);
        assert!(!at.join("scan").exists());
    }
    // An unknown identification with a stated family.
    let options = change(|o| "ACME,VNA-1,0,1.0".clone_into(&mut o.identity));
    let analyser = SimulatedVna::start(options);
    let text = experiment(analyser.port, 3, "dialect = \"rohde-schwarz\"", AT_ONCE);
    captured(at, &text, "").succeeded();
}

#[test]
fn absent_analyser_is_reported_with_its_address() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    // A port without a listener.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    drop(listener);
    let text = experiment(port, 3, "", AT_ONCE).replace("connections = 40", "connections = 2");
    let place = format!("cannot connect to 127.0.0.1, port {port}");
    captured(at, &text, "").failed(1, &["failed 2 times", &place]);
    assert!(!at.join("scan").exists());
}

#[test]
fn unsuitable_keys_and_folders_are_refused() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let good = experiment(1, 3, "", AT_ONCE);
    for (text, parts) in [
        (
            good.replace("sweeps = 3", "sweeps = 3\ndwell = \"1 ms\""),
            vec!["vna.toml:7:1", "unknown key 'dwell'"],
        ),
        (
            good.replace("step = \"5 MHz\"\n", ""),
            vec!["[plan] needs 'step'"],
        ),
        (
            good.replace("[scan]", "[radio]\nclock = \"internal\"\n[scan]"),
            vec!["unknown key 'radio'"],
        ),
        (
            good.replace("[scan]", "parameter = \"s19\"\n[scan]"),
            vec!["at most 4 ports", "\"s19\""],
        ),
        (
            good.replace("mode = \"immediate\"", "mode = \"free\""),
            vec!["'step' does not apply to mode = \"free\""],
        ),
        (
            good.replace("mode = \"immediate\"", "mode = \"interval\""),
            vec!["[scan] needs 'interval'"],
        ),
        (
            format!("{good}positions = \"stops.csv\"\n"),
            vec!["positions", "found both"],
        ),
    ] {
        captured(at, &text, "").failed(1, &parts);
    }
    captured(at, &good, "--live").failed(2, &["--live does not apply"]);
    fs::create_dir(at.join("scan")).unwrap();
    fs::write(at.join("scan/notes.txt"), "mine").unwrap();
    captured(at, &good, "").failed(
        1,
        &["scan: expected a new or empty folder", "choose another"],
    );
    fs::write(at.join("scan/capture.json"), "{}").unwrap();
    captured(at, &good, "").failed(1, &["capture.json: expected the record of a capture"]);
}

#[test]
fn keys_example_and_forecast_need_no_analyser() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let keys = run(at, "capture --keys");
    for key in ["if_bandwidth", "kind = \"vna\"", "interval", "byte_order"] {
        assert!(keys.succeeded().contains(key), "{key}");
    }
    let example = run(at, "capture --example vna");
    fs::write(at.join("vna.toml"), example.succeeded()).unwrap();
    let before = listing(at);
    run(at, "capture vna.toml").failed(2, &["--out", "files.recording"]);
    let line = "capture vna.toml -o scan --dry-run --json";
    let forecast: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let near = |value: &Value, expected: f64| {
        let value = value.as_f64().unwrap();
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
    };
    // 201 points, each the reciprocal of 10 kHz.
    near(&forecast["sweep_s"], 0.0201);
    near(&forecast["time_s"], 121.0 * 0.0201);
    near(&forecast["unambiguous_m"], 299_792_458.0 / 1e7);
    // A quarter wavelength of the highest frequency, 3 GHz, in a sweep.
    let followed = &forecast["speed"]["limits"]["followed_m_s"];
    near(followed, 299_792_458.0 / (4.0 * 3e9 * 0.0201));
    let text = run(at, "capture vna.toml -o scan --dry-run");
    for part in ["201 from 2 GHz", "points / IF bandwidth", "fastest"] {
        assert!(text.succeeded().contains(part), "{part}: {text:?}");
    }
    let interval = [
        "capture",
        "vna.toml",
        "-o",
        "scan",
        "--dry-run",
        "--json",
        "--set",
        "scan.mode=interval",
        "--set",
        "scan.interval=2 s",
    ];
    let output = command(at, interval).output().unwrap();
    let forecast: Value = serde_json::from_slice(&output.stdout).unwrap();
    near(&forecast["time_s"], 242.0);
    assert!(
        run(at, "info vna.toml")
            .succeeded()
            .contains("network analyser at 192.168.1.20")
    );
    run(at, "radio probe vna.toml").failed(1, &["unknown value \"vna\""]);
    assert_eq!(listing(at), before);
}
