//! `subap radio selftest` on the simulated radio: table, report, exit status.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{listing, run, write_thesis_experiment};
use tempfile::TempDir;

/// A folder with the examples `thesis.toml` and `scene.toml`.
fn examples() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_thesis_experiment(folder.path());
    folder
}

fn report(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn verdict<'a>(report: &'a Value, name: &str) -> &'a str {
    let mut checks = report["checks"].as_array().unwrap().iter();
    let check = checks.find(|check| check["name"] == name).unwrap();
    check["verdict"].as_str().unwrap()
}

#[test]
fn healthy_radio_is_reported_as_passed_and_simulated() {
    let folder = examples();
    let at = folder.path();
    let ran = run(at, "radio selftest thesis.toml --stream 0.2 -o report.json");
    let table = ran.succeeded();
    for part in [
        "simulated B210, SIM00001, driver subaperture",
        ", simulated",
        "retune time",
        "at most 19 ms        passed",
        "reference clock: lock",
        "not measured: the device runs on its internal clock",
        "report.json: report",
    ] {
        assert!(table.contains(part), "no {part} in\n{table}");
    }
    let written = report(&at.join("report.json"));
    assert_eq!(written["schema"], "subaperture-radio-selftest");
    assert_eq!(written["simulated"], true);
    assert_eq!(written["passed"], true);
    assert_eq!(written["plan"]["steps"], 50);
    assert_eq!(written["settings"]["sample_rate_hz"], 1e6);
    assert_eq!(written["retunes"].as_array().unwrap().len(), 8);
    assert_eq!(verdict(&written, "noise floor: receiver 1"), "passed");
    // The same report on standard output. It replaces the earlier one, and no file of another program.
    fs::write(at.join("other.json"), "{\"own\": 1}").unwrap();
    let line = "radio selftest thesis.toml --stream 0.2 --json -o";
    run(at, &format!("{line} other.json")).failed(1, &["other.json", "--force"]);
    let ran = run(at, &format!("{line} report.json"));
    let said: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(said["checks"], written["checks"]);
    assert_eq!(said["files"][0]["kind"], "record");
}

#[test]
fn failed_checks_exit_1_with_advice_and_a_complete_report() {
    let folder = examples();
    let at = folder.path();
    let text = fs::read_to_string(at.join("thesis.toml")).unwrap();
    let faulty = format!("{text}\n[faults]\noverflow = 0.2\nlate = 0.2\n");
    fs::write(at.join("faulty.toml"), faulty).unwrap();
    let scene = fs::read_to_string(at.join("scene.toml")).unwrap();
    let scene = scene.replace("power = \"-20 dB\"", "power = \"6 dB\"");
    fs::write(at.join("noisy-scene.toml"), scene).unwrap();
    for (line, name, advice) in [
        ("faulty.toml", "overruns", "USB 3"),
        ("faulty.toml", "late commands", "plan.lead"),
        (
            "thesis.toml --set device.scenario=noisy-scene.toml",
            "noise floor: receiver 0",
            "attenuation",
        ),
        (
            "thesis.toml --delay 30ns",
            "loop-back delay",
            "expected delay",
        ),
    ] {
        let line = format!("radio selftest {line} --stream 0.2 -o {}.json", name.len());
        let ran = run(at, &line);
        ran.failed(1, &["failed"]);
        let advised = format!("{name}: failed: ");
        let mut lines = ran.stdout.lines();
        let said = lines.find(|line| line.starts_with(&advised));
        assert!(said.is_some_and(|said| said.contains(advice)), "{ran:?}");
        let written = report(&at.join(format!("{}.json", name.len())));
        assert_eq!(verdict(&written, name), "failed");
        assert_eq!(written["passed"], false);
    }
}

#[test]
fn recording_is_refused_as_radio() {
    let folder = examples();
    let at = folder.path();
    let text = fs::read_to_string(at.join("thesis.toml")).unwrap();
    let (plan, _) = text.split_once("[device]").unwrap();
    let replay = format!("{plan}[device]\nkind = \"replay\"\nrecording = \"walk\"\n");
    fs::write(at.join("replay.toml"), replay).unwrap();
    let before = listing(at);
    run(at, "radio selftest replay.toml -o report.json").failed(1, &["expected a radio", "walk"]);
    assert_eq!(listing(at), before);
}
