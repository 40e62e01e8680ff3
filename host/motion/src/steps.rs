//! A track of poses that were found together, as increments whose errors are independent of one another.
//!
//! Smoothers that know other sensors take increments, and take their errors for independent. Those of a joint estimate are not: what noise a pose has of its own comes with one sign in the increment before
//! it and with the other in that after it, and is gone in their sum; what errors of the targets' places make of the track goes on from increment to increment, and grows
//! with their number where independent errors grow with its root. With `A` the derivative of an increment, in the axes of its first pose, by the targets, `T` their covariance and `W` what
//! poses have of their own, each of `N` increments is told to have
//!
//! ```text
//! N A T A' + (W_k + W_(k+1)) / N
//! ```
//!
//! so that the whole chain is about as uncertain from its first pose to its last as it is, and parts of it are taken for more uncertain than they are: other sensors may bend it, slowly, and
//! its shape over short times stays that of the echoes.

use glam::{DMat2, DMat3, DVec2, DVec3};

use crate::increment::Increment;
use crate::joint::Covariances;
use crate::model::Pose;

/// The increments between poses, each with the covariance of x, y and turn as of independent ones.
pub(crate) fn steps(poses: &[Pose], known: &Covariances) -> Vec<(Increment, DMat3)> {
    let count = poses.len().saturating_sub(1) as f64;
    let step = |(k, pair): (usize, &[Pose])| {
        let increment = Increment::between(&pair[0], &pair[1]);
        let [before, after] = slopes(&pair[0], &increment);
        let by_targets = known.by_targets(&[(k, -before), (k + 1, after)]);
        let own = [(k, before), (k + 1, after)].map(|(n, slope)| {
            let own = known.alone(n);
            slope * own * slope.transpose()
        });
        (
            increment,
            by_targets * count + (own[0] + own[1]) * (1.0 / count),
        )
    };
    poses.windows(2).enumerate().map(step).collect()
}

/// How an increment changes with the pose before it, the other way, and with that after it.
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
    fn slopes_are_differences() {
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
