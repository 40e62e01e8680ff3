//! Error ellipses of tracks, compared with the errors over many seeds.

use super::*;
use subaperture_motion::Track;
use subaperture_motion::joint::Datum;

/// Quantile 0.95 of chi-square with two degrees of freedom.
const NINETY_FIVE: f64 = 5.991_464_547;

/// Errors of positions after least-squares alignment with the truth by rotation and translation, in the track's axes, metres.
fn aligned_errors_m(estimated: &[Pose], truth: &[Pose]) -> Vec<DVec2> {
    let count = estimated.len() as f64;
    let mean = |poses: &[Pose]| poses.iter().map(|pose| pose.at_m).sum::<DVec2>() / count;
    let (a, b) = (mean(estimated), mean(truth));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (got, wanted) in estimated.iter().zip(truth) {
        dot += (got.at_m - a).dot(wanted.at_m - b);
        cross += (wanted.at_m - b).perp_dot(got.at_m - a);
    }
    let turn = DVec2::from_angle(cross.atan2(dot));
    let each = estimated.iter().zip(truth);
    each.map(|(got, wanted)| got.at_m - a - turn.rotate(wanted.at_m - b))
        .collect()
}

/// Share of poses within their 95 % ellipses, and RMS error of the aligned track, metres.
fn covered(track: &Track, truth: &[Pose]) -> [f64; 2] {
    let known = track.joint_covariances.aligned(&track.poses, Datum::Shape);
    let errors = aligned_errors_m(&track.poses, truth);
    let (mut within, mut square) = (0usize, 0.0);
    for (error, known) in errors.iter().zip(&known) {
        let c = known.own + known.by_targets;
        let c = glam::DMat2::from_cols(c.x_axis.truncate(), c.y_axis.truncate());
        within += usize::from(error.dot(c.inverse() * *error) < NINETY_FIVE);
        square += error.length_squared();
    }
    let count = errors.len() as f64;
    [within as f64 / count, (square / count).sqrt()]
}

/// Mean over seeds of the share of covered poses, and the standard deviation of the mean.
fn shares(receivers: usize, snr_db: f64, seeds: u64) -> [f64; 2] {
    let (poses, array) = (poses(1000)[..250].to_vec(), array(receivers));
    let noise = Noise::of_snr(snr_db);
    let mut all = Vec::new();
    for seed in 0..seeds {
        let pulses = seen(&array, &poses, &noise, seed);
        let track = track(&array, &pulses, WINDOW).unwrap();
        all.push(covered(&track, &poses)[0]);
    }
    let count = seeds as f64;
    let mean = all.iter().sum::<f64>() / count;
    let square = all.iter().map(|share| (share - mean).powi(2)).sum::<f64>();
    [mean, (square / (count * (count - 1.0))).sqrt()]
}

/// Errors are correlated over many poses of a track, so that the covered share scatters from seed to seed. The mean must be 0.95 within four of its standard deviations plus 0.01 for second-order
/// errors at 10 dB.
#[test]
fn ellipses_of_aligned_track_cover_95_percent_of_errors() {
    for (receivers, snr_db) in [(2, 10.0), (2, 20.0), (3, 15.0), (4, 30.0)] {
        let [mean, sigma] = shares(receivers, snr_db, 12);
        println!(
            "{receivers} receivers, {snr_db} dB: {mean:.3} +- {sigma:.3} of poses in their ellipses"
        );
        assert!((mean - 0.95).abs() < 4.0 * sigma + 0.01, "{mean} {sigma}");
        // The covered share of one track scatters by at most 0.2: the mean of 12 seeds by 0.06.
        assert!(sigma < 0.08, "{sigma}");
    }
}

/// Aligned covariances are independent of the gauge that the least squares hold.
#[test]
fn alignment_with_first_pose_leaves_first_pose_without_error() {
    let (poses, array, noise) = (poses(1000)[..60].to_vec(), array(2), Noise::of_snr(20.0));
    let track = track(&array, &seen(&array, &poses, &noise, 1), WINDOW).unwrap();
    let known = track.joint_covariances.aligned(&track.poses, Datum::First);
    let first = known[0].own + known[0].by_targets;
    let last = known[59].own + known[59].by_targets;
    // The first position is held to a micrometre; the aligned first heading has no error by definition.
    assert!(first.x_axis.x < 1e-11 && first.y_axis.y < 1e-11, "{first}");
    assert!(first.z_axis.z.abs() < 1e-12, "{first}");
    assert!(last.x_axis.x > 1e-10, "{last}");
    // The error of the first heading rotates the track about its first position and moves the last one across the track.
    let held = track.covariances[59];
    let turned = track.covariances[0].z_axis.z * track.poses[59].at_m.length_squared();
    assert!(
        last.y_axis.y > 0.5 * turned && turned > held.y_axis.y,
        "{last} {held}"
    );
}
