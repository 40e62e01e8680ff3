//! Crossing targets among false alarms.

use std::collections::{BTreeMap, BTreeSet};

use subaperture_gmti::tracker::{Settings, Status, Track, Tracker};

use crate::world::{Random, Truth, quadratic, scan, sensor};

const TARGETS: usize = 10;
const SCANS: usize = 60;
const DENSITY: f64 = 0.1;

/// Counts and sums over all runs.
#[derive(Debug, Default)]
struct Measured {
    /// Detections of targets from scan 5 on, and those that updated a confirmed track.
    detected: usize,
    held: usize,
    /// Changes of the confirmed track that a target's detections update.
    swaps: usize,
    /// Confirmed tracks in all, and those with fewer than half of their detections from one target.
    confirmed: usize,
    spurious: usize,
    /// Estimates of confirmed tracks, those whose 95 % ellipse contains the target, and the sum of squared position errors.
    estimates: usize,
    contained: usize,
    squares_m2: f64,
    /// Sum of the position variances.
    variances_m2: f64,
}

/// Target of most detections of a track, and whether it has at least half of them.
fn owner(track: &Track, labels: &[Vec<Option<usize>>]) -> Option<usize> {
    let mut counts: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    for estimate in &track.history {
        if let Some(index) = estimate.detection {
            let label = labels[estimate.time_s as usize][index];
            *counts.entry(label).or_default() += 1;
        }
    }
    let total: usize = counts.values().sum();
    let (label, count) = counts.into_iter().max_by_key(|&(_, count)| count)?;
    label.filter(|_| 2 * count >= total)
}

fn run(seed: u64, measured: &mut Measured) {
    let mut random = Random::new(seed);
    let mut truths: Vec<Truth> = (0..TARGETS)
        .map(|i| {
            // All pass the middle of the square within 100 m, around 30 s.
            let speed = 1.0 + 19.0 * i as f64 / (TARGETS - 1) as f64;
            let heading = random.uniform(0.0, std::f64::consts::TAU);
            let (vx, vy) = (speed * heading.cos(), speed * heading.sin());
            let middle = [0, 1].map(|_| random.uniform(-100.0, 100.0));
            [middle[0] - 30.0 * vx, middle[1] - 30.0 * vy, vx, vy]
        })
        .collect();
    let settings = Settings {
        acceleration_density_m2_s3: DENSITY,
        ..Settings::default()
    };
    let mut tracker = Tracker::new(settings).unwrap();
    let mut labels: Vec<Vec<Option<usize>>> = Vec::new();
    let mut history: Vec<Vec<Truth>> = Vec::new();
    let mut holders = [None; TARGETS];
    let mut confirmed = BTreeSet::new();
    for i in 0..SCANS {
        let time_s = i as f64;
        let from = sensor(time_s);
        let mut detections = random.false_alarms(5.0, from);
        let mut label = vec![None; detections.len()];
        for (target, truth) in truths.iter_mut().enumerate() {
            if i > 0 {
                random.moved(truth, 1.0, DENSITY);
            }
            if random.uniform(0.0, 1.0) < 0.9 {
                detections.push(random.detection(truth, from));
                label.push(Some(target));
            }
        }
        tracker.scan(&scan(time_s, detections)).unwrap();
        labels.push(label);
        history.push(truths.clone());
        if i >= 5 {
            measured.detected += labels[i].iter().flatten().count();
        }
        for track in tracker.tracks() {
            if !matches!(track.status, Status::Confirmed { .. }) {
                continue;
            }
            confirmed.insert(track.id);
            let last = track.history.last().unwrap();
            if let Some(target) = last.detection.and_then(|index| labels[i][index]) {
                measured.held += usize::from(i >= 5);
                let before = holders[target].replace(track.id);
                measured.swaps += usize::from(before.is_some_and(|id| id != track.id));
            }
        }
    }
    let tracks = tracker.tracks().iter();
    let tracks: Vec<&Track> = tracks.filter(|t| confirmed.contains(&t.id)).collect();
    assert_eq!(tracks.len(), confirmed.len());
    measured.confirmed += tracks.len();
    for track in tracks {
        let Some(target) = owner(track, &labels) else {
            measured.spurious += 1;
            continue;
        };
        // Estimates after initiation, up to the last detection.
        let last = track.history.iter().rposition(|e| e.detection.is_some());
        for estimate in &track.history[3..=last.unwrap()] {
            let truth = history[estimate.time_s as usize][target];
            let [xx, xy] = [estimate.covariance[0][0], estimate.covariance[0][1]];
            let yy = estimate.covariance[1][1];
            let error = [estimate.mean[0] - truth[0], estimate.mean[1] - truth[1]];
            let distance = quadratic([[xx, xy], [xy, yy]], error);
            measured.estimates += 1;
            // Chi-square of 2 degrees of freedom: -2 ln(0.05).
            measured.contained += usize::from(distance <= -2.0 * 0.05f64.ln());
            measured.squares_m2 += error[0] * error[0] + error[1] * error[1];
            measured.variances_m2 += xx + yy;
        }
    }
}

/// 10 targets of 1 to 20 m/s that cross within 100 m, detection probability 0.9, 5 false alarms per scan over 1 km^2, 60 scans at 1 s; 10 runs.
#[test]
fn crossing_targets_keep_their_tracks() {
    let mut measured = Measured::default();
    for seed in 0..10 {
        run(seed, &mut measured);
    }
    let held = measured.held as f64 / measured.detected as f64;
    let contained = measured.contained as f64 / measured.estimates as f64;
    let rms_m = (measured.squares_m2 / measured.estimates as f64).sqrt();
    let predicted_m = (measured.variances_m2 / measured.estimates as f64).sqrt();
    eprintln!("{measured:?}");
    eprintln!(
        "held {held:.4}, contained {contained:.4}, RMS {rms_m:.2} m, predicted {predicted_m:.2} m"
    );
    // Targets: 100.
    assert!(held > 0.99, "{held}");
    assert!(measured.spurious == 0, "{measured:?}");
    assert!(measured.confirmed <= 102, "{measured:?}");
    assert!(measured.swaps <= 2, "{measured:?}");
    assert!((0.90..0.98).contains(&contained), "{contained}");
    assert!(
        (rms_m / predicted_m - 1.0).abs() < 0.1,
        "{rms_m} {predicted_m}"
    );
}
