//! Refused settings and scans, and limits of memory.

use glam::DVec3;
use subaperture_gmti::tracker::{Detection, Plane, Scan, Settings, Status, Tracker, TrackerError};

use crate::world::{detection, scan};

fn at(x_m: f64, y_m: f64) -> Detection {
    detection(DVec3::new(x_m, y_m, 0.0), 3.0, [-40.0, 2.0])
}

#[test]
fn refused_scans_leave_the_tracks_unchanged() {
    let mut tracker = Tracker::new(Settings::default()).unwrap();
    tracker.scan(&scan(1.0, vec![at(0.0, 0.0)])).unwrap();
    let before = tracker.tracks().to_vec();
    let mut refused = |scan, text: &str| {
        let error: TrackerError = tracker.scan(&scan).unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
        assert_eq!(tracker.tracks(), before);
    };
    refused(
        scan(1.0, vec![]),
        "expected a finite time after 1 s, found 1 s",
    );
    refused(scan(f64::NAN, vec![]), "found NaN s");
    let mut other = scan(2.0, vec![]);
    other.sensor_m.z = f64::INFINITY;
    refused(other, "expected a finite radar position");
    let mut other = scan(2.0, vec![]);
    other.sensor_velocity_m_s.x = f64::NAN;
    refused(other, "expected a finite radar velocity");
    refused(
        scan(2.0, vec![at(1.0, 1.0); 2001]),
        "expected at most 2000 detections, found 2001",
    );
    let with = |change: fn(&mut Detection)| {
        let mut changed = at(1.0, 1.0);
        change(&mut changed);
        scan(2.0, vec![at(5.0, 5.0), changed])
    };
    refused(
        with(|d| d.position_m.y = f64::NAN),
        "detection 1: expected finite values, found NaN as position_m.y",
    );
    refused(
        with(|d| d.radial_velocity_m_s = f64::INFINITY),
        "found inf as radial_velocity_m_s",
    );
    refused(
        with(|d| d.covariance[0][2] = 5.0),
        "detection 1: expected a symmetric positive definite covariance",
    );
    refused(with(|d| d.covariance[2][2] = 0.0), "positive definite");
    refused(with(|d| d.covariance[1][1] = f64::NAN), "positive definite");
    refused(
        with(|d| d.velocity_ambiguity_m_s = Some(0.0)),
        "expected a velocity ambiguity above 0, found 0 m/s",
    );
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |change: fn(&mut Settings), text: &str| {
        let mut settings = Settings::default();
        change(&mut settings);
        let error = Tracker::new(settings).unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    };
    refused(|s| s.detection_probability = 1.0, "detection_probability");
    refused(|s| s.gate_probability = 0.0, "gate_probability");
    refused(|s| s.false_alarm_density = -1.0, "false_alarm_density");
    refused(|s| s.new_target_density = f64::NAN, "new_target_density");
    refused(
        |s| s.tangential_deviation_m_s = 0.0,
        "tangential_deviation_m_s",
    );
    refused(
        |s| s.acceleration_density_m2_s3 = -0.1,
        "acceleration_density_m2_s3",
    );
    refused(|s| s.false_confirmation_probability = 0.5, "below 0.5");
    refused(
        |s| s.true_deletion_probability = 0.0,
        "true_deletion_probability",
    );
    refused(
        |s| s.max_tracks = 0,
        "max_tracks: expected at least 1, found 0",
    );
    refused(|s| s.max_history = 0, "max_history");
    refused(
        |s| s.plane.y_axis = DVec3::X,
        "two perpendicular unit vectors",
    );
    refused(
        |s| s.plane = Plane::horizontal(f64::INFINITY),
        "finite origin",
    );
}

#[test]
fn numbers_of_tracks_and_history_entries_are_bounded() {
    let settings = Settings {
        max_tracks: 3,
        max_tentative: 2,
        max_history: 5,
        ..Settings::default()
    };
    let mut tracker = Tracker::new(settings).unwrap();
    let three = vec![at(-400.0, 0.0), at(0.0, 0.0), at(400.0, 0.0)];
    tracker.scan(&scan(0.0, three)).unwrap();
    assert_eq!(tracker.tracks().len(), 2);
    assert_eq!(tracker.not_initiated(), 1);
    let deleted = |status: &Status| matches!(status, Status::Deleted { .. });
    // Ten targets, one after the other: each is confirmed and deleted.
    for i in 1..100 {
        let time_s = f64::from(i);
        let place = f64::from(i / 10) * 100.0 - 450.0;
        let seen = match i % 10 < 5 {
            true => vec![at(place, -3.0 * f64::from(i % 10))],
            false => Vec::new(),
        };
        tracker.scan(&scan(time_s, seen)).unwrap();
        assert!(tracker.tracks().len() <= 3);
        for track in tracker.tracks() {
            assert!(track.history.len() <= 5);
            let last = track.history.last().unwrap();
            assert!(deleted(&track.status) || last.time_s == time_s);
        }
    }
    let kept = tracker.tracks().iter();
    assert_eq!(kept.filter(|track| deleted(&track.status)).count(), 3);
    // The earliest were discarded.
    assert!(tracker.tracks()[0].id > 5);
}

#[test]
fn extreme_values_do_not_panic() {
    let mut tracker = Tracker::new(Settings::default()).unwrap();
    let mut far = at(1e200, -1e200);
    far.radial_velocity_m_s = 1e300;
    let mut wide = at(1.0, 2.0);
    wide.covariance = [[1e300, 0.0, 0.0], [0.0, 1e300, 0.0], [0.0, 0.0, 1e300]];
    let mut narrow = at(1.0, 2.0);
    narrow.covariance = [[1e-300, 0.0, 0.0], [0.0, 1e-300, 0.0], [0.0, 0.0, 1e-300]];
    narrow.velocity_ambiguity_m_s = Some(1e-300);
    for time_s in [-1e300f64, -1e100, 0.0, 1e-200, 1.0, 2.0, 1e150, 1e308] {
        let detections = vec![far, wide, narrow, at(0.0, 0.0)];
        for (time_s, sensor_m) in [
            (time_s, DVec3::new(1e3, -5e3, 1e3)),
            (time_s.next_up(), DVec3::new(0.0, 0.0, 1e3)),
            (time_s.next_up().next_up(), DVec3::ZERO),
            (time_s.next_up().next_up().next_up(), DVec3::splat(1e300)),
        ] {
            let detections = detections.clone();
            let scan = Scan {
                time_s,
                sensor_m,
                sensor_velocity_m_s: sensor_m,
                detections,
            };
            tracker.scan(&scan).unwrap();
        }
    }
}
