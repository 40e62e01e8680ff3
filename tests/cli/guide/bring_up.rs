//! Pages for the first steps with hardware: run on the simulated radio and the emulated module, and complete.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::root;

use super::{B210, NUCLEO, Page};

/// Assert that a report passed, and that the page has a row of advice for each of its checks.
fn assert_report(folder: &Path, file: &str, page: &str, mark: &str) {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let report: Value = serde_json::from_slice(&fs::read(folder.join(file)).unwrap()).unwrap();
    assert_eq!(
        (&report["passed"], &report[mark]),
        (&true.into(), &true.into())
    );
    let rows: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("| `"))
        .collect();
    for check in report["checks"].as_array().unwrap() {
        let name = format!("`{}`", check["name"].as_str().unwrap());
        assert!(rows.iter().any(|row| row.contains(&name)), "{page}: {name}");
    }
}

#[test]
fn b210_page_runs_on_simulated_radio_and_advises_on_every_check() {
    let folder = Page::read(B210).run();
    assert_report(folder.path(), "report.json", B210, "simulated");
}

#[test]
fn nucleo_page_runs_under_emulation_and_advises_on_every_check() {
    let folder = Page::read(NUCLEO).run();
    assert_report(folder.path(), "emulated.json", NUCLEO, "emulated");
    // The checksums of step 3 are those that the tests of the core hold.
    let recorded = fs::read_to_string(root().join("tests/stream/selftest.rs")).unwrap();
    let page = fs::read_to_string(root().join(NUCLEO)).unwrap();
    for name in ["FLOAT_STREAM_CHECKSUM", "FIXED_STREAM_CHECKSUM"] {
        let (_, value) = recorded.split_once(&format!("{name}: u32 = ")).unwrap();
        let value = value.split(';').next().unwrap().replace('_', "");
        assert!(page.contains(&value), "{name}: {value}");
    }
}
