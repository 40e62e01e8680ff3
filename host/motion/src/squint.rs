//! The array's squint: by how much its axis is turned from where the description of the body has it.
//!
//! **What phases tell of it: nothing.** Antennas lie at `p + turned(a, heading + squint)`, and whatever is measured depends on where antennas are: squint and heading enter by their sum
//! alone. For any squint there are headings, less by as much, that agree with all phases and ranges equally well: least squares that had both as unknowns would be singular, jointly
//! over all pulses ([`crate::joint`]) as pulse by pulse ([`crate::pairwise`], [`crate::robust`]). So all of these find the array's own heading, and the motion along the array's own axes.
//! A heading that another source tells does not help by itself: the frame turns with it.
//!
//! **What tells it** is the body's motion along its own axes, known otherwise: a rail, a vehicle that does not slip sideways, satellite positions with a heading. The same motion, found along the
//! array's axes, is turned by the squint. It is the drift in range of C 7.5.1, whose radar moved along a rail:
//!
//! ```text
//! told = turned(found, squint)       squint = atan2(sum w found x told, sum w found . told)       w = 1 / sigma^2
//! sigma_squint^2 = 1 / sum w |found| |told|
//! ```
//!
//! by least squares over stretches of the track. Where the radar has not moved by much more than it is known to, that is refused.
//!
//! **Units** metres, radians, counterclockwise. **Accuracy** `tests/squint.rs`. **Errors** [`NoSquint`].

use glam::DVec2;

use crate::increment::Increment;
use crate::model::Pose;
use crate::series::unit;

/// A squint that is told to no better than this is not told.
const WORST_RAD: f64 = 0.2;

/// A stretch of a track, told twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Along the array's axes: see [`travelled`]. Metres.
    pub found_m: DVec2,
    /// Along the body's, as another source tells it.
    pub told_m: DVec2,
    /// Standard deviation of their difference, either way, metres.
    pub sigma_m: f64,
}

/// A squint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squint {
    /// From the body's axis to the array's.
    pub squint_rad: f64,
    /// Its standard deviation.
    pub sigma_rad: f64,
    /// The sum of squared differences that are left, in standard deviations, and how many there are beyond what is found. It tells whether both speak of one motion.
    pub chi_square: [f64; 2],
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoSquint {
    /// Nothing was travelled, or too little.
    #[error(
        "over {travelled_m:.4} m the direction of travel is known to {sigma_rad:.3} rad: too little to tell a squint, which phases alone never do"
    )]
    TooLittle {
        /// As found.
        travelled_m: f64,
        /// Of the squint.
        sigma_rad: f64,
    },
    /// A leg that is none.
    #[error("leg {0} has a number that is none, or a standard deviation that is not above 0")]
    Leg(usize),
}

impl Leg {
    /// Of a body that goes where its x axis points, by as much as is found.
    pub fn along_axis(found_m: DVec2, sigma_m: f64) -> Self {
        Self {
            found_m,
            told_m: DVec2::new(found_m.length(), 0.0),
            sigma_m,
        }
    }
}

/// What increments add up to along the array's own axes, however it turns meanwhile.
pub fn travelled(increments: impl IntoIterator<Item = Increment>) -> DVec2 {
    // Seen from half way.
    let each = increments.into_iter();
    each.map(|increment| unit(-0.5 * increment.turn_rad).rotate(increment.moved_m))
        .sum()
}

/// The increments between poses.
pub fn increments(poses: &[Pose]) -> impl Iterator<Item = Increment> {
    let pairs = poses.windows(2);
    pairs.map(|pair| Increment::between(&pair[0], &pair[1]))
}

/// The squint that legs tell.
///
/// # Errors
/// [`NoSquint`].
pub fn squint(legs: &[Leg]) -> Result<Squint, NoSquint> {
    let (mut dot, mut cross, mut information, mut travelled_m) = (0.0, 0.0, 0.0, 0.0);
    for (n, leg) in legs.iter().enumerate() {
        let is_known = leg.found_m.is_finite() && leg.told_m.is_finite() && leg.sigma_m.is_finite();
        if !is_known || leg.sigma_m <= 0.0 {
            return Err(NoSquint::Leg(n));
        }
        let weight = 1.0 / (leg.sigma_m * leg.sigma_m);
        dot += weight * leg.found_m.dot(leg.told_m);
        cross += weight * leg.found_m.perp_dot(leg.told_m);
        information += weight * leg.found_m.length() * leg.told_m.length();
        travelled_m += leg.found_m.length();
    }
    let sigma_rad = 1.0 / libm::sqrt(information);
    if sigma_rad.is_nan() || sigma_rad > WORST_RAD {
        return Err(NoSquint::TooLittle {
            travelled_m,
            sigma_rad,
        });
    }
    let squint_rad = libm::atan2(cross, dot);
    let turn = unit(squint_rad);
    let off = |leg: &Leg| (leg.told_m - turn.rotate(leg.found_m)).length() / leg.sigma_m;
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
    /// Poses of the body, in its own frame at the first, of poses of the array in its own.
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
