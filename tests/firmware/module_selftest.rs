//! `subap module selftest` on the emulated module: a report that says so.

use std::fs;
use std::net::TcpListener;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::firmware::{INSTRUCTION_TIME, emulator};
use subaperture_tests::subap::run;

use crate::emulated::application;

fn report(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn check<'a>(report: &'a Value, name: &str) -> &'a Value {
    let mut checks = report["checks"].as_array().unwrap().iter();
    checks.find(|check| check["name"] == name).unwrap()
}

#[test]
fn emulated_modules_pass_and_are_reported_as_emulated() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, elf) in ["float", "fixed"].iter().zip(application()) {
        let line = format!(
            "module selftest emulate:{name} --firmware {} -o {name}.json",
            elf.display()
        );
        let ran = run(at, &line);
        let table = ran.succeeded();
        println!("{table}");
        assert!(table.contains(&format!("in {name} at emulate:{name}, emulated")));
        let report = report(&at.join(format!("{name}.json")));
        assert_eq!(report["schema"], "subaperture-module-selftest");
        assert_eq!(report["emulated"], true);
        assert_eq!(report["passed"], true);
        assert_eq!(report["arithmetic"], **name);
        for product in [
            "maps",
            "image",
            "detections",
            "increments",
            "range profiles",
        ] {
            assert_eq!(check(&report, product)["value"], 0.0, "{product}");
        }
        for name in ["rate to the module", "rate from the module"] {
            assert!(
                check(&report, name)["value"].as_f64() > Some(0.0),
                "{report}"
            );
        }
        assert_eq!(check(&report, "stack")["verdict"], "passed");
        assert_eq!(
            check(&report, "cycles per instruction")["verdict"],
            "not measured"
        );
        assert_eq!(report["runs"].as_array().unwrap().len(), 5, "{report}");
    }
}

/// With time tied to instructions the timer of the emulated board has 1.25 ticks for each. Steps that find no work, and the
/// reading of the timer, add to the processing: they are allowed a twentieth.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn instructions_of_the_maps_are_those_that_the_cycles_are_compared_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, elf) in ["float", "fixed"].iter().zip(application()) {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr();
        let port = free.unwrap().port();
        let serial = format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
        let options = ["-monitor", "none", "-nic", "none", "-serial", &serial];
        let mut board = emulator(elf, &[&options[..], &INSTRUCTION_TIME].concat());
        let line = format!("module selftest tcp://127.0.0.1:{port} -o {name}.json");
        let mut ran = run(at, &line);
        // The emulator opens its port after a moment.
        for _ in 0..20 {
            if ran.code == Some(0) {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(200));
            ran = run(at, &line);
        }
        board.kill().unwrap();
        board.wait().unwrap();
        ran.succeeded();
        let report = report(&at.join(format!("{name}.json")));
        // The rate of the module's timer says that it is emulated.
        assert_eq!(report["emulated"], true);
        let measured = report["runs"][0]["kiloticks"].as_f64().unwrap() * 1e3 / 1.25;
        let stated = report["instructions"].as_f64().unwrap();
        println!("{name}: {measured} instructions, {stated} stated");
        assert!(
            (measured / stated - 1.0).abs() < 0.05,
            "{name}: {measured}, {stated} stated"
        );
    }
}
