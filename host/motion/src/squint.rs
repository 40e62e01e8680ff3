//! Squint of the array: the angle of its axis against its description.
//!
//! **Phases do not determine it.** Antennas lie at `p + turned(a, heading + squint)`: squint and heading enter all measurements by their sum alone. For any squint, headings that are less by as much fit all
//! phases and ranges equally well, and least squares with both as unknowns are singular, jointly ([`crate::joint`]) as pulse by pulse ([`crate::pairwise`], [`crate::robust`]). All of these estimate the heading
//! of the array and motion along the array's axes. A heading from another source does not help by itself: the frame turns with it.
//!
//! **Motion along the body's axes determines it**, if known otherwise: a rail, a vehicle without side slip, satellite positions with a heading. The same motion along the array's axes is turned by the squint. It is the
//! drift in range of C 7.5.1, whose radar moved along a rail:
//!
//! ```text
//! reference = turned(estimated, squint)       squint = atan2(sum w estimated x reference, sum w estimated . reference)       w = 1 / sigma^2
//! sigma_squint^2 = 1 / sum w |estimated| |reference|
//! ```
//!
//! by least squares over segments of the track. A track that has not moved by much more than its standard deviation is refused.
//!
//! **Units** metres, radians, counterclockwise. **Accuracy** `tests/squint.rs`. **Errors** [`SquintError`].

use glam::DVec2;

use crate::increment::Increment;
use crate::model::Pose;
use crate::series::unit;

/// Largest standard deviation of a squint, radians: a less certain one is refused.
const WORST_RAD: f64 = 0.2;

/// Segment of a track, measured twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Motion along the array's axes ([`travelled`]), metres.
    pub estimated_m: DVec2,
    /// Motion along the body's axes by another source, metres.
    pub reference_m: DVec2,
    /// Standard deviation of their difference in either direction, metres.
    pub sigma_m: f64,
}

/// Estimated squint with its accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squint {
    /// Angle from the body's axis to the array's, radians, counterclockwise.
    pub squint_rad: f64,
    /// Standard deviation of the squint, radians.
    pub sigma_rad: f64,
    /// Sum of squared residuals in standard deviations, and its expectation: a larger sum means that the sources contradict each other.
    pub chi_square: [f64; 2],
}

/// Reason why a squint cannot be estimated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SquintError {
    /// The motion is too short.
    #[error(
        "squint needs more motion: over {travelled_m:.4} m the direction of travel has a standard deviation of {sigma_rad:.3} rad, expected at most {} rad",
        WORST_RAD
    )]
    TooLittle {
        /// Estimated length of the track, metres.
        travelled_m: f64,
        /// Standard deviation of the squint, radians.
        sigma_rad: f64,
    },
    /// Invalid leg, by its number.
    #[error(
        "leg {0}: expected finite displacements in metres and a finite standard deviation above 0 m"
    )]
    Leg(usize),
}

impl Leg {
    /// Leg of a body that moves along its x axis, by the estimated length.
    pub fn along_axis(estimated_m: DVec2, sigma_m: f64) -> Self {
        Self {
            estimated_m,
            reference_m: DVec2::new(estimated_m.length(), 0.0),
            sigma_m,
        }
    }
}

/// Sum of increments along the array's own axes, whatever its turns.
pub fn travelled(increments: impl IntoIterator<Item = Increment>) -> DVec2 {
    // Seen from half-way.
    let each = increments.into_iter();
    each.map(|increment| unit(-0.5 * increment.turn_rad).rotate(increment.moved_m))
        .sum()
}

/// Increments between successive poses.
pub fn increments(poses: &[Pose]) -> impl Iterator<Item = Increment> {
    let pairs = poses.windows(2);
    pairs.map(|pair| Increment::between(&pair[0], &pair[1]))
}

/// Estimate the squint from segments of a track.
///
/// # Errors
/// [`SquintError`].
pub fn squint(legs: &[Leg]) -> Result<Squint, SquintError> {
    let (mut dot, mut cross, mut information, mut travelled_m) = (0.0, 0.0, 0.0, 0.0);
    for (n, leg) in legs.iter().enumerate() {
        let is_finite =
            leg.estimated_m.is_finite() && leg.reference_m.is_finite() && leg.sigma_m.is_finite();
        if !is_finite || leg.sigma_m <= 0.0 {
            return Err(SquintError::Leg(n));
        }
        let weight = 1.0 / (leg.sigma_m * leg.sigma_m);
        dot += weight * leg.estimated_m.dot(leg.reference_m);
        cross += weight * leg.estimated_m.perp_dot(leg.reference_m);
        information += weight * leg.estimated_m.length() * leg.reference_m.length();
        travelled_m += leg.estimated_m.length();
    }
    let sigma_rad = 1.0 / libm::sqrt(information);
    if sigma_rad.is_nan() || sigma_rad > WORST_RAD {
        return Err(SquintError::TooLittle {
            travelled_m,
            sigma_rad,
        });
    }
    let squint_rad = libm::atan2(cross, dot);
    let turn = unit(squint_rad);
    let off = |leg: &Leg| (leg.reference_m - turn.rotate(leg.estimated_m)).length() / leg.sigma_m;
    Ok(Squint {
        squint_rad,
        sigma_rad,
        chi_square: [
            legs.iter().map(|leg| off(leg).powi(2)).sum(),
            2.0 * legs.len() as f64 - 1.0,
        ],
    })
}

impl Squint {
    /// Poses of the body in its frame at the first pulse, from poses of the array.
    pub fn of_body(&self, poses: &[Pose]) -> Vec<Pose> {
        let Some(first) = poses.first() else {
            return Vec::new();
        };
        let turn = unit(self.squint_rad - first.heading_rad);
        let each = poses.iter().map(|pose| Pose {
            at_m: turn.rotate(pose.at_m - first.at_m),
            heading_rad: pose.heading_rad - first.heading_rad,
        });
        each.collect()
    }
}
