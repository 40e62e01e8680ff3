//! Live view of a capture, against its recording.

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;

use subaperture_radio::Transceiver;
use subaperture_radio::capture::{Queues, Summary, capture, setup};
use subaperture_radio::fault::{Faults, Faulty};
use subaperture_radio::live::{LiveState, LiveSweep, SweepAssembler, View};
use subaperture_radio::plan::Plan;
use subaperture_radio::profile::{Options, Reference, Sweep};
use subaperture_radio::sigmf::Recording;
use tempfile::TempDir;

use crate::profile::{REACH_M, WINDOW, calibration};
use crate::scene::{THESIS, experiment, plan, radio};

/// Run a capture with a follower attached, and return the live sweeps.
fn followed(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    folder: &TempDir,
    view: View,
) -> (Summary, LiveState, Vec<LiveSweep>) {
    let set = radio.configure(&plan.radio).unwrap();
    let setup = setup(radio.about(), plan, &set);
    let bytes = plan.bytes_a_second(&radio.about().ranges);
    let (mut follower, board) = SweepAssembler::new(plan, &setup, bytes, view).unwrap();
    let (sender, steps) = sync_channel(1 << 10);
    let path = folder.path().join("live");
    let stop = AtomicBool::new(false);
    let queues = Queues::default();
    let summary = capture(radio, plan, &path, queues, Some(&sender), &stop).unwrap();
    drop(sender);
    let mut sweeps: Vec<LiveSweep> = steps
        .iter()
        .filter_map(|step| follower.take(&board, &step))
        .collect();
    sweeps.extend(follower.end(&board));
    (summary, board, sweeps)
}

/// Live sweeps, with injected link faults, are bit-identical to those read from the recording, in frequency response
/// and profile. Rows of the waterfall are the profile's maxima per column.
#[test]
fn live_sweeps_are_bit_identical_to_recorded_ones() {
    let folder = TempDir::new().unwrap();
    let calibration = calibration(&folder);
    let experiment = experiment(THESIS, 21);
    let faults = Faults {
        seed: 5,
        overflow: 0.1,
        lost_packet: 0.1,
        late: 0.05,
        ..Faults::default()
    };
    let mut radio = Faulty::new(radio(&experiment), faults);
    let plan = plan("sweeps = 3\norder = \"up-down\"");
    let view = View {
        rows: 2,
        window: WINDOW,
        profile: Options {
            reach_m: Some(REACH_M),
            calibration: Some(calibration.clone()),
            ..Options::default()
        },
        disk: Some(folder.path().join("live")),
        ..View::default()
    };
    let (summary, board, sweeps) = followed(&mut radio, &plan, &folder, view);
    let mut recording = Recording::open(&folder.path().join("live")).unwrap();
    assert_eq!(sweeps.len(), 3);
    for (index, live) in sweeps.iter().enumerate() {
        let read = Sweep::read(&mut recording, index as u64, Reference::Loopback).unwrap();
        let read = calibration.apply(recording.setup(), &read).unwrap();
        assert!(
            read.usable() < 50 && read.usable() > 33,
            "{}",
            read.usable()
        );
        assert_eq!((live.index, &live.receivers[0]), (index as u64, &read));
        let profile = live.profile.as_ref().unwrap();
        let fineness = profile.values.len() / 50;
        assert_eq!(*profile, read.profile(WINDOW, fineness, REACH_M).unwrap());
    }
    let (status, _) = board.status();
    let rows = board.rows_after(None);
    assert_eq!((rows.len(), rows[1].sweep, status.sweep), (2, 2, Some(2)));
    let last = sweeps[2].profile.as_ref().unwrap();
    let spacing_m = REACH_M / (rows[1].levels_db.len() - 1) as f64;
    for peak in last.peaks(0.05) {
        // The row's column next to the peak has its level, less the scalloping loss of the profile: at most 0.3 dB.
        let level_db = rows[1].levels_db[(peak.range_m / spacing_m).round() as usize];
        let off_db = f64::from(level_db) - 20.0 * peak.magnitude.log10();
        assert!(
            (-0.3..0.1).contains(&off_db),
            "{} m: {off_db}",
            peak.range_m
        );
    }
    // Both count the same events.
    let counts = status.counts;
    assert_eq!((counts.steps, counts.not_shown), (150, 0));
    assert_eq!(
        (counts.flagged, counts.events),
        (summary.flagged, summary.events)
    );
    assert_eq!(
        (counts.bursts, counts.lost_samples),
        (summary.bursts, summary.lost_samples)
    );
    assert!(counts.events.iter().sum::<u64>() > 0 && status.calibrated);
    assert!(status.free_bytes.is_some() && status.disk_lasts_s.unwrap() > 1.0);
    // A step takes 6 ms: two retunes of 2 ms, a lead and a dwell of 1 ms. A late step takes 5 ms. Each further burst
    // takes 2 ms more, and the plan allows seven.
    let rate_hz = status.rate_hz.unwrap();
    assert!(
        (1.0 / (50.0 * 20e-3)..1.0 / (50.0 * 5e-3)).contains(&rate_hz),
        "{rate_hz}"
    );
}

/// Levels equal those of the recorded samples, and an excessive gain shows as clipping.
#[test]
fn live_levels_match_recording_and_report_clipping() {
    let folder = TempDir::new().unwrap();
    let experiment = experiment(THESIS, 22);
    let mut loud = plan("");
    loud.radio.receive_gain_db[1] = 70.0;
    let (_, board, _) = followed(&mut radio(&experiment), &loud, &folder, View::default());
    let (status, _) = board.status();
    let mut recording = Recording::open(&folder.path().join("live")).unwrap();
    let (mut channels, mut power, mut peak) = (<[Vec<_>; 2]>::default(), [0.0; 2], [0.0f64; 2]);
    let mut count = 0.0;
    for index in 0..50 {
        recording.read(index, &mut channels).unwrap();
        count += channels[0].len() as f64;
        for (c, channel) in channels.iter().enumerate() {
            for s in channel {
                let [i, q] = [s.re, s.im].map(|x| f64::from(x) / 32768.0);
                power[c] += i * i + q * q;
                peak[c] = peak[c].max(i.abs()).max(q.abs());
            }
        }
    }
    for (c, level) in status.levels.iter().enumerate() {
        // Both sums are exact except for some thousand roundings of 1e-16.
        assert!((level.rms * level.rms / (power[c] / count) - 1.0).abs() < 1e-12);
        assert_eq!(level.peak, peak[c]);
    }
    assert_eq!(status.levels[0].clipped, 0);
    assert!(
        status.levels[1].clipped > 1000 && status.flagged[3] == 50,
        "{status:?}"
    );
}

/// A queue of eight steps is not read during a sweep of fifty. A radio in real time does not wait, dropped steps are counted,
/// and the incomplete sweep gives an empty row.
#[test]
fn slow_viewer_does_not_delay_capture() {
    let folder = TempDir::new().unwrap();
    let experiment = experiment(THESIS, 23);
    let mut radio = radio(&experiment).in_real_time();
    let plan = plan("");
    let set = radio.configure(&plan.radio).unwrap();
    let setup = setup(radio.about(), &plan, &set);
    let (mut follower, board) = SweepAssembler::new(&plan, &setup, 1.0, View::default()).unwrap();
    let (sender, steps) = sync_channel(8);
    let path = folder.path().join("live");
    let stop = AtomicBool::new(false);
    let summary = capture(
        &mut radio,
        &plan,
        &path,
        Queues::default(),
        Some(&sender),
        &stop,
    );
    let summary = summary.unwrap();
    assert_eq!(
        (summary.steps, summary.not_shown, summary.waits),
        (50, 42, 0)
    );
    drop(sender);
    assert!(
        steps
            .iter()
            .all(|step| follower.take(&board, &step).is_none())
    );
    let sweep = follower.end(&board).unwrap();
    assert!(sweep.receivers[0].usable() == 8 && sweep.profile.is_none());
    assert_eq!(board.rows_after(None)[0].levels_db, [] as [f32; 0]);
    assert!(board.latest_row().is_none() && follower.end(&board).is_none());
}

/// A viewer takes 5 ms for each step, by a queue of two. A radio out of real time waits for it: all fifty steps are shown.
#[test]
fn simulated_radio_waits_for_a_slow_viewer() {
    let folder = TempDir::new().unwrap();
    let experiment = experiment(THESIS, 23);
    let mut radio = radio(&experiment);
    let plan = plan("");
    let (sender, steps) = sync_channel(2);
    let path = folder.path().join("live");
    let stop = AtomicBool::new(false);
    let viewer = thread::spawn(move || {
        let each = steps
            .iter()
            .inspect(|_| thread::sleep(Duration::from_millis(5)));
        each.count()
    });
    let queues = Queues::default();
    let summary = capture(&mut radio, &plan, &path, queues, Some(&sender), &stop).unwrap();
    drop(sender);
    assert_eq!((summary.steps, summary.not_shown), (50, 0));
    assert_eq!(viewer.join().unwrap(), 50);
}
