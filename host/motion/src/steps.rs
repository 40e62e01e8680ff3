//! Increments of a jointly estimated track with covariances for filters that assume independent increments.
//!
//! Fusion with other sensors takes increments and assumes independent errors. Increments of a joint estimate are not independent: the own noise of a pose enters the increments before and after it with
//! opposite signs and cancels in their sum, and errors of target positions are common to all increments and grow with their number, not with its root. With `A` the derivative of an increment by the
//! targets in the axes of its first pose, `T` the covariance of the targets and `W` the own covariances of poses, each of `N` increments is given the covariance
//!
//! ```text
//! N A T A' + (W_k + W_(k+1)) / N
//! ```
//!
//! The whole chain is then about as uncertain from its first pose to its last as the joint estimate. Covariances of shorter parts are too large: other sensors may bend the track slowly, and its shape over short times
//! stays that of the echoes.

use glam::{DMat2, DMat3, DVec2, DVec3};

use crate::increment::Increment;
use crate::joint::Covariances;
use crate::model::Pose;

/// Increments between poses, each with the covariance of x, y and turn for use as independent errors.
pub(crate) fn steps(poses: &[Pose], covariances: &Covariances) -> Vec<(Increment, DMat3)> {
    let count = poses.len().saturating_sub(1) as f64;
    let step = |(k, pair): (usize, &[Pose])| {
        let increment = Increment::between(&pair[0], &pair[1]);
        let [before, after] = slopes(&pair[0], &increment);
        let by_targets = covariances.by_targets(&[(k, -before), (k + 1, after)]);
        let own = [(k, before), (k + 1, after)].map(|(n, slope)| {
            let own = covariances.alone(n);
            slope * own * slope.transpose()
        });
        (
            increment,
            by_targets * count + (own[0] + own[1]) * (1.0 / count),
        )
    };
    poses.windows(2).enumerate().map(step).collect()
}

/// Derivatives of an increment by the pose before it, with negative sign, and by the pose after it.
fn slopes(from: &Pose, increment: &Increment) -> [DMat3; 2] {
    let (sin, cos) = libm::sincos(-from.heading_rad);
    let turn = DMat3::from_mat2(DMat2::from_cols(
        DVec2::new(cos, sin),
        DVec2::new(-sin, cos),
    ));
    let by_heading = increment.moved_m.perp().extend(1.0);
    let before = DMat3::from_cols(turn.x_axis, turn.y_axis, by_heading);
    [before, DMat3::from_cols(turn.x_axis, turn.y_axis, DVec3::Z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn increment_derivatives_equal_central_differences() {
        let pose = |x, y, heading_rad| Pose {
            at_m: DVec2::new(x, y),
            heading_rad,
        };
        let (from, to) = (pose(0.3, -0.2, 0.7), pose(0.5, 0.1, 0.9));
        let [before, after] = slopes(&from, &Increment::between(&from, &to));
        let h = 1e-6;
        for k in 0..3 {
            let moved = |pose: &Pose, by: f64| {
                let mut pose = *pose;
                match k {
                    0 => pose.at_m.x += by,
                    1 => pose.at_m.y += by,
                    _ => pose.heading_rad += by,
                }
                pose
            };
            let numbers = |i: &Increment| i.moved_m.extend(i.turn_rad);
            let difference = |a: Increment, b: Increment| (numbers(&a) - numbers(&b)) / (2.0 * h);
            let of_before = difference(
                Increment::between(&moved(&from, h), &to),
                Increment::between(&moved(&from, -h), &to),
            );
            let of_after = difference(
                Increment::between(&from, &moved(&to, h)),
                Increment::between(&from, &moved(&to, -h)),
            );
            // Rounding of 1e-16 over 1e-6.
            assert!(of_before.distance(-before.col(k)) < 1e-9, "{k}");
            assert!(of_after.distance(after.col(k)) < 1e-9, "{k}");
        }
    }
}
