//! Complete captures by the binding on the stand-in library backed by the simulated radio, and on UHD itself without a device.
//!
//! The library of a program is fixed at its start, so each capture is a process of this executable, which runs the one test that the
//! variable [`FOLDER`] enables.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::atomic::AtomicBool;

use subaperture_describe::Description;
use subaperture_radio::capture::{EndReason, Queues, Summary, capture};
use subaperture_radio::plan::Plan;
use subaperture_radio::sigmf::{Flag, Recording, Step};
use subaperture_radio::uhd::{Options, UhdRadio, Wire, list};
use subaperture_radio::{RadioError, Side, Source, Transceiver};
use tempfile::TempDir;

use crate::loading::with_stand_in_loaded;
use crate::scene;

/// Folder in which the process records.
const FOLDER: &str = "SUBAPERTURE_UHD_TEST_FOLDER";

/// Run a test in a separate process that loads the stand-in for UHD.
fn with_stand_in(test: &str, folder: &Path, faults: &str) -> Output {
    let program = std::env::current_exe().unwrap();
    with_stand_in_loaded(&program, &folder.join("libraries"), faults)
        .args(["--exact", &format!("uhd_binding::{test}"), "--nocapture"])
        .env(FOLDER, folder)
        .output()
        .unwrap()
}

/// A plan of 50 carriers.
fn plan() -> Plan {
    let text =
        "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\norder = \"shuffled\"\n";
    Plan::describe(&Description::new("plan.toml", text, ".")).expect("the plan is right")
}

fn captured(radio: &mut dyn Transceiver, path: &Path) -> Summary {
    let stop = AtomicBool::new(false);
    capture(radio, &plan(), path, Queues::default(), None, &stop).unwrap()
}

/// The binding's part of a capture; without the variable this test does nothing.
#[test]
fn capture_in_separate_process() {
    let Some(folder) = std::env::var_os(FOLDER) else {
        return;
    };
    let folder = PathBuf::from(folder);
    let faults = std::env::var(scene::FAULTS).unwrap();
    if faults == "images" || faults == "two" {
        let refused = UhdRadio::open(&Options::default()).unwrap_err();
        fs::write(folder.join("refused"), refused.to_string()).unwrap();
        return;
    }
    assert_eq!(list(None).unwrap()[0].serial, "SIM00001");
    assert!(list(Some("other")).unwrap().is_empty());
    // Its converter has 12 bits.
    let wire = if faults == "faults" {
        Wire::Sc12
    } else {
        Wire::Sc16
    };
    let options = Options {
        serial: Some("SIM00001".to_owned()),
        wire,
        ..Options::default()
    };
    let mut radio = UhdRadio::open(&options).unwrap();
    assert_eq!(radio.about().product, "B210");
    // Its synthesisers cannot be tuned at a given time.
    let refused = radio.tune(Side::Receive, 1.2e9, Some(1.0)).unwrap_err();
    assert!(matches!(refused, RadioError::Unsupported(_)));
    // The reference clock locks after some time.
    let mut external = plan().radio;
    external.clock = Source::External;
    radio.configure(&external).unwrap();
    let sensors = radio.sensors().unwrap();
    assert_eq!(sensors.reference_locked, Some(true));
    assert_eq!(sensors.temperature_c, Some(31.5));
    assert!(!sensors.transmit_locked && !sensors.receive_locked);
    // An external time source that is not connected is refused.
    let mut wrong = plan().radio;
    wrong.pps = Source::External;
    let refused = radio.configure(&wrong).unwrap_err().to_string();
    assert!(refused.contains("PPS"), "{refused}");
    let summary = captured(&mut radio, &folder.join("by-uhd"));
    fs::write(folder.join("summary"), counted(&summary)).unwrap();
}

/// All counts, without the speed of the disk.
fn counted(summary: &Summary) -> String {
    let ended = match &summary.ended {
        EndReason::Done => "done",
        EndReason::Stopped => "stopped",
        EndReason::Radio(_) => "radio",
        EndReason::Disk(_) => "disk",
    };
    format!(
        "{ended} {:?}",
        (
            summary.steps,
            summary.flagged,
            summary.bursts,
            summary.events,
            summary.lost_samples,
            summary.late_sweeps,
            &summary.set
        )
    )
}

/// Recorded steps. The simulated fault makes a step late by changing its time, which a driver does not see.
fn steps(recording: &Recording) -> Vec<Step> {
    let mut steps = recording.steps().to_vec();
    for step in &mut steps {
        if step.flags.contains(&Flag::Late) {
            step.time_s = 0.0;
        }
    }
    steps
}

/// Capture through the binding and from the simulated radio, and compare; returns the counts.
fn compare(faults: &str) -> String {
    let folder = TempDir::new().unwrap();
    let output = with_stand_in("capture_in_separate_process", folder.path(), faults);
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    let experiment = scene::experiment();
    let mut radio = scene::radio(&experiment, faults);
    let directly = folder.path().join("directly");
    let summary = counted(&captured(&mut radio, &directly));
    println!("{summary}");
    assert_eq!(
        fs::read_to_string(folder.path().join("summary")).unwrap(),
        summary
    );
    let by_uhd = folder.path().join("by-uhd");
    let samples = |path: &Path| fs::read(path.with_extension("sigmf-data")).unwrap();
    assert!(!samples(&directly).is_empty());
    assert!(
        samples(&by_uhd) == samples(&directly),
        "samples are not the same"
    );
    let [by_uhd, directly] = [by_uhd, directly].map(|path| Recording::open(&path).unwrap());
    assert_eq!(steps(&by_uhd), steps(&directly));
    summary
}

#[test]
fn capture_through_uhd_equals_that_of_simulated_radio() {
    assert!(compare("").starts_with("done (50, [0, 0, 0, 0, 0], "));
}

#[test]
fn faults_through_uhd_equal_those_of_simulated_radio() {
    let experiment = scene::experiment();
    let folder = TempDir::new().unwrap();
    let mut radio = scene::radio(&experiment, "faults");
    let summary = captured(&mut radio, &folder.path().join("faults"));
    // Every kind of fault occurs.
    assert!(summary.flagged[..2].iter().all(|&count| count > 0));
    assert!(
        summary.events[..4].iter().all(|&count| count > 0),
        "{summary:?}"
    );
    compare("faults");
}

#[test]
fn unplugged_device_ends_the_capture_and_keeps_the_samples() {
    let summary = compare("unplug");
    assert!(summary.starts_with("radio ("), "{summary}");
}

/// The error when the radio is opened.
fn refused(faults: &str) -> String {
    let folder = TempDir::new().unwrap();
    let output = with_stand_in("capture_in_separate_process", folder.path(), faults);
    assert!(output.status.success(), "{output:?}");
    fs::read_to_string(folder.path().join("refused")).unwrap()
}

#[test]
fn two_radios_need_a_serial_number() {
    let refused = refused("two");
    assert!(refused.contains("SIM00001, SIM00002"), "{refused}");
}

#[test]
fn missing_images_are_reported_with_advice() {
    let refused = refused("images");
    assert!(
        refused.contains("usrp_b200_fw.hex") && refused.contains("uhd_images_downloader"),
        "{refused}"
    );
}

/// UHD itself does not find a device with this serial number.
#[test]
fn missing_device_is_reported_with_advice() {
    if std::env::var_os(FOLDER).is_some() {
        return;
    }
    let options = Options {
        serial: Some("NONE0000".to_owned()),
        ..Options::default()
    };
    let refused = UhdRadio::open(&options).unwrap_err().to_string();
    println!("{refused}");
    assert!(
        refused.contains("NONE0000") && refused.contains("cable") && refused.contains("udev"),
        "{refused}"
    );
}
