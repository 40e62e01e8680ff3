//! Confirmation of tracks of false alarms, and deletion of tracks without a target.

use std::collections::BTreeSet;

use subaperture_gmti::tracker::{Settings, Status, Tracker};

use crate::world::{FASTEST_M_S, HALF_M, Random, scan, sensor};

/// Numbers of started and of confirmed tracks of 200 scans with 5 false alarms each.
fn confirmed(settings: Settings, ambiguity_m_s: Option<f64>, seed: u64) -> (u64, usize) {
    let mut random = Random::new(seed);
    let mut tracker = Tracker::new(settings).unwrap();
    let (mut started, mut confirmed) = (0, BTreeSet::new());
    for i in 0..200 {
        let time_s = f64::from(i);
        let mut detections = random.false_alarms(5.0, sensor(time_s));
        for detection in &mut detections {
            if let Some(interval_m_s) = ambiguity_m_s {
                // Uniform in the interval.
                detection.radial_velocity_m_s *= 0.5 * interval_m_s / FASTEST_M_S;
            }
            detection.velocity_ambiguity_m_s = ambiguity_m_s;
        }
        tracker.scan(&scan(time_s, detections)).unwrap();
        for track in tracker.tracks() {
            started = started.max(track.id);
            if track.status != Status::Tentative {
                confirmed.insert(track.id);
            }
        }
    }
    assert_eq!(tracker.not_initiated(), 0);
    (started, confirmed.len())
}

#[test]
fn false_alarms_are_confirmed_within_the_stated_probability() {
    for (probability, ambiguity_m_s) in [
        (1e-4, None),
        (1e-2, None),
        (0.1, None),
        (1e-2, Some(7.5)),
        (0.1, Some(7.5)),
    ] {
        let width_m_s = ambiguity_m_s.unwrap_or(2.0 * FASTEST_M_S);
        let settings = Settings {
            false_confirmation_probability: probability,
            false_alarm_density: 5.0 / (4.0 * HALF_M * HALF_M * width_m_s),
            ..Settings::default()
        };
        let (mut started, mut found) = (0, 0);
        for seed in 0..10 {
            let (tracks, confirmed) = confirmed(settings, ambiguity_m_s, seed);
            started += tracks;
            found += confirmed;
        }
        let expected = started as f64 * probability / (1.0 - settings.true_deletion_probability);
        eprintln!(
            "probability {probability}, ambiguity {ambiguity_m_s:?}: {found} of {started} confirmed, bound {expected:.1}"
        );
        assert!(started > 8000);
        // Two standard deviations of a Poisson count at the bound.
        assert!(found as f64 <= expected + 2.0 * expected.sqrt(), "{found}");
    }
}

/// Without false alarms, four misses of a probability of 0.1 lower the score by `-4 ln 0.1 = -ln 1e-4`.
#[test]
fn vanished_target_is_deleted_after_four_scans() {
    let mut random = Random::new(3);
    let mut tracker = Tracker::new(Settings::default()).unwrap();
    let mut truth = [50.0, -80.0, 6.0, -9.0];
    for i in 0..40 {
        let time_s = f64::from(i);
        random.moved(&mut truth, 1.0, 0.1);
        let seen = match i < 30 {
            true => vec![random.detection(&truth, sensor(time_s))],
            false => Vec::new(),
        };
        tracker.scan(&scan(time_s, seen)).unwrap();
        let [track] = tracker.tracks() else {
            panic!("{:?}", tracker.tracks());
        };
        match i {
            0 => assert_eq!(track.status, Status::Tentative),
            3..33 => assert!(matches!(track.status, Status::Confirmed { time_s } if time_s <= 3.0)),
            33.. => {
                assert_eq!(track.status, Status::Deleted { time_s: 33.0 });
                assert_eq!(track.history.len(), 34);
                assert_eq!(track.history[29].detection, Some(0));
                assert!(track.history[30..].iter().all(|e| e.detection.is_none()));
            }
            _ => {}
        }
    }
}

/// A tentative track of one false alarm leaves no trace.
#[test]
fn single_detection_is_removed_after_four_scans() {
    let mut random = Random::new(4);
    let mut tracker = Tracker::new(Settings::default()).unwrap();
    let seen = random.detection(&[0.0, 0.0, 3.0, 4.0], sensor(0.0));
    tracker.scan(&scan(0.0, vec![seen])).unwrap();
    for i in 1..=4 {
        assert_eq!(tracker.tracks().len(), 1);
        tracker.scan(&scan(f64::from(i), Vec::new())).unwrap();
    }
    assert!(tracker.tracks().is_empty());
}

/// Among 5 false alarms per scan, and with a detection probability of 0.9 before the target stops.
#[test]
fn stopped_target_is_deleted_among_false_alarms() {
    let mut latest_s = 0.0f64;
    for seed in 0..100 {
        let mut random = Random::new(seed);
        let mut tracker = Tracker::new(Settings::default()).unwrap();
        let mut truth = [0.0, 0.0, 8.0, 7.0];
        let mut holder = None;
        for i in 0..50 {
            let time_s = f64::from(i);
            let from = sensor(time_s);
            random.moved(&mut truth, 1.0, 0.1);
            let mut detections = random.false_alarms(5.0, from);
            let seen = i < 30 && random.uniform(0.0, 1.0) < 0.9;
            if seen {
                detections.push(random.detection(&truth, from));
            }
            let own = detections.len() - usize::from(seen);
            tracker.scan(&scan(time_s, detections)).unwrap();
            for track in tracker.tracks() {
                let last = track.history.last().unwrap();
                if seen && last.time_s == time_s && last.detection == Some(own) {
                    holder = Some(track.id);
                }
            }
        }
        let track = tracker.tracks().iter().find(|t| Some(t.id) == holder);
        let Some(Status::Deleted { time_s }) = track.map(|track| track.status) else {
            panic!("seed {seed}: {track:?}");
        };
        latest_s = latest_s.max(time_s - 29.0);
    }
    eprintln!("latest deletion {latest_s} s after the last possible detection");
    assert!(latest_s <= 6.0, "{latest_s}");
}
