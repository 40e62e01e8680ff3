//! Tracks with known headings.

use super::*;
use glam::DMat2;
use subaperture_motion::{Tracker, track_with_headings};

const PULSES: usize = 200;

/// Chi-square of the last pose's error over seeds, of the batch and of the online track, and its degrees of freedom.
fn squares(receivers: usize, snr_db: f64, seeds: u64) -> [f64; 3] {
    let (poses, array) = (&poses(1000)[..PULSES], array(receivers));
    let noise = Noise::of_snr(snr_db);
    let headings_rad: Vec<f64> = poses.iter().map(|pose| pose.heading_rad).collect();
    let last = &poses[PULSES - 1];
    // The frame is that of the headings: errors need no rotation.
    let square = |pose: &Pose, covariance: &glam::DMat3| {
        assert_eq!(pose.heading_rad, last.heading_rad);
        let error = pose.at_m - last.at_m;
        let [x, y] = [covariance.x_axis, covariance.y_axis].map(|axis| axis.truncate());
        error.dot(DMat2::from_cols(x, y).inverse() * error)
    };
    let mut sums = [0.0; 2];
    for seed in 0..seeds {
        let pulses = seen(&array, poses, &noise, seed);
        let batch = track_with_headings(&array, &pulses, &headings_rad, WINDOW).unwrap();
        assert!(batch.converged, "{seed}");
        let [chi, free] = batch.chi_square;
        assert!(
            (chi - free).abs() < 5.0 * (2.0 * free).sqrt(),
            "{chi} {free}"
        );
        sums[0] += square(&batch.poses[PULSES - 1], &batch.covariances[PULSES - 1]);
        let mut tracker = Tracker::with_known_headings(array.clone(), WINDOW).unwrap();
        let mut live = None;
        for (pulse, heading_rad) in pulses.iter().zip(&headings_rad) {
            tracker.set_heading(*heading_rad);
            live = Some(tracker.push(pulse).unwrap());
        }
        let live = live.unwrap();
        sums[1] += square(&live.pose, &live.covariance);
    }
    let count = 2.0 * seeds as f64;
    println!("{receivers} receivers, {snr_db} dB: chi-square {sums:.1?} of {count}");
    [sums[0], sums[1], count]
}

/// Chi-square must be within four standard deviations of its degrees of freedom `n`; its standard deviation is `sqrt(2 n)`.
#[test]
fn errors_with_known_headings_agree_with_covariance() {
    for (receivers, snr_db) in [(2, 15.0), (4, 30.0)] {
        let [batch, live, count] = squares(receivers, snr_db, 16);
        for sum in [batch, live] {
            assert!(
                (sum - count).abs() < 4.0 * (2.0 * count).sqrt(),
                "{sum} of {count}"
            );
        }
    }
}

#[test]
fn missing_or_non_finite_heading_is_refused() {
    let (poses, array, noise) = (poses(1000)[..20].to_vec(), array(2), Noise::of_snr(30.0));
    let pulses = seen(&array, &poses, &noise, 1);
    for headings in [vec![0.0; 19], vec![f64::NAN; 20]] {
        let refused = track_with_headings(&array, &pulses, &headings, WINDOW).unwrap_err();
        assert!(
            matches!(refused, (0, MotionError::Headings { .. })),
            "{refused:?}"
        );
    }
}
