//! Overruns, late commands, lost packets, disconnection, and a stop during a capture.

use std::sync::atomic::AtomicBool;

use subaperture_radio::RadioError;
use subaperture_radio::capture::{EndReason, Queues, capture};
use subaperture_radio::fault::{Faults, Faulty};
use subaperture_radio::profile::{Reference, Sweep};
use subaperture_radio::sigmf::{Flag, Recording};
use tempfile::TempDir;

use crate::profile::{REACH_M, WINDOW, assert_thesis, calibration};
use crate::scene::{THESIS, captured, experiment, plan, radio};

fn count(recording: &Recording, flag: Flag) -> u64 {
    recording
        .steps()
        .iter()
        .filter(|step| step.flags.contains(&flag))
        .count() as u64
}

#[test]
fn steps_with_faults_are_flagged_and_profile_of_the_rest_is_correct() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("faults");
    let experiment = experiment(THESIS, 13);
    let faults = Faults {
        overflow: 0.08,
        lost_packet: 0.1,
        late: 0.08,
        underflow: 0.05,
        packet: 120,
        unplug_at: None,
        seed: 3,
    };
    let mut radio = Faulty::new(radio(&experiment), faults);
    let summary = captured(
        &mut radio,
        &plan("order = \"shuffled\"\nsweeps = 2\n"),
        &path,
    );
    println!("{summary:?}");
    assert!(matches!(summary.ended, EndReason::Done));
    let mut recording = Recording::open(&path).unwrap();
    assert_eq!(recording.steps().len(), 100);
    let flagged = [
        Flag::Late,
        Flag::Lost,
        Flag::Unsteady,
        Flag::Clipped,
        Flag::Unlocked,
    ]
    .map(|f| count(&recording, f));
    assert_eq!(flagged, summary.flagged);
    let lost = recording
        .steps()
        .iter()
        .flat_map(|step| &step.lost)
        .map(|gap| (gap.1 - gap.0) as u64);
    assert_eq!(lost.sum::<u64>(), summary.lost_samples);
    // Each kind of fault occurs among a hundred steps.
    assert!(flagged[0] > 0 && flagged[1] > 0, "{flagged:?}");
    assert!(
        summary.events[0] > 0
            && summary.events[1] > 0
            && summary.events[2] >= flagged[0]
            && summary.events[3] > 0
    );
    let calibration = calibration(&folder);
    for sweep in 0..2 {
        let sweep = Sweep::read(&mut recording, sweep, Reference::Loopback).unwrap();
        assert!(sweep.usable() < 50, "no step was skipped");
        let sweep = calibration.apply(recording.setup(), &sweep).unwrap();
        assert_thesis(&sweep.profile(WINDOW, 24, REACH_M).unwrap());
    }
}

#[test]
fn disconnected_radio_leaves_valid_recording() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("unplugged");
    let experiment = experiment(THESIS, 13);
    let faults = Faults {
        unplug_at: Some(40),
        ..Faults::default()
    };
    let mut radio = Faulty::new(radio(&experiment), faults);
    let summary = captured(&mut radio, &plan(""), &path);
    assert!(
        matches!(summary.ended, EndReason::Radio(RadioError::Gone(_))),
        "{summary:?}"
    );
    assert_eq!(summary.events[4], 1);
    let recording = Recording::open(&path).unwrap();
    assert!(
        !recording.interrupted()
            && summary.steps > 0
            && recording.steps().len() as u64 == summary.steps
    );
}

#[test]
fn stopped_capture_is_complete_and_is_not_overwritten() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("stopped");
    let experiment = experiment(THESIS, 13);
    let (plan, stop) = (plan("sweeps = 0\n"), AtomicBool::new(false));
    let (live, shown) = std::sync::mpsc::sync_channel(7);
    let summary = std::thread::scope(|scope| {
        let stop = &stop;
        scope.spawn(move || {
            // The live view reads seven steps, then closes.
            shown.iter().take(7).for_each(drop);
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        });
        capture(
            &mut radio(&experiment),
            &plan,
            &path,
            Queues { disk: 2 },
            Some(&live),
            stop,
        )
        .unwrap()
    });
    assert!(
        matches!(summary.ended, EndReason::Stopped) && summary.steps >= 7,
        "{summary:?}"
    );
    assert!(summary.longest_queue <= 2);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.steps().len() as u64, summary.steps);
    let again = capture(
        &mut radio(&experiment),
        &plan,
        &path,
        Queues::default(),
        None,
        &stop,
    );
    assert!(again.unwrap_err().to_string().contains("never overwritten"));
}
