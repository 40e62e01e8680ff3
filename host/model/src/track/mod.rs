//! Trajectories of radars and targets as functions of time.
//!
//! | track | position | velocity |
//! |---|---|---|
//! | [`Linear`], [`Circular`] | smooth | smooth |
//! | [`Spline`], [`SampledTrack`], [`Displacement`] | twice continuously differentiable | continuous |
//! | [`StateVectors`] | continuous to rounding, and to the error of the interpolation | as the position |
//! | [`Profile`] | once continuously differentiable | continuous |
//! | [`Waypoints`], [`Rail`], [`Arc`] | continuous | jumps at waypoints, ends and turns |
//!
//! All are continuous: a jump of position would be a phase jump of the echo by `4 pi / lambda` radians per metre,
//! which no real track has. A pose is a function of time alone, so it can be evaluated at any time, in any order and
//! from any thread. Accuracy far from the start is that of float64: a microsecond is resolved up to 1e9 s.
//!
//! By default a body's heading is along its velocity: the x axis follows the velocity, and the y axis stays level
//! ([`heading`]). Roll, pitch and yaw are right-handed about x, y and z of the body ([`turned`]); since y is left,
//! positive pitch is nose down.

mod arc;
mod body;
mod circular;
mod cubic;
mod displacement;
mod linear;
mod profile;
mod rail;
mod sampled_track;
mod spline;
mod state_vectors;
mod strays;
mod waypoints;

use glam::{DQuat, DVec3, EulerRot};

use crate::SPEED_OF_LIGHT_M_S;

pub use arc::Arc;
pub use body::{Pose, Trajectory};
pub use circular::Circular;
pub use displacement::Displacement;
pub use linear::Linear;
pub use profile::Profile;
pub use rail::Rail;
pub use sampled_track::{Fix, SampledTrack};
pub use spline::Spline;
pub use state_vectors::{StateVectors, orbit_rate_rad_s};
pub(crate) use strays::joined;
pub use strays::strays;
pub use waypoints::Waypoints;

/// Error of an invalid track description, with a remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("track: {0}")]
pub struct TrackError(pub String);

/// Attitude of a body that moves along a velocity without roll: x along the velocity, y level. For vertical motion y
/// is along the scene's y axis; for a body at rest the attitude is the scene's axes.
#[inline]
pub fn heading(velocity: DVec3) -> DQuat {
    let pitch = -libm::atan2(velocity.z, libm::hypot(velocity.x, velocity.y));
    turned(0.0, pitch, libm::atan2(velocity.y, velocity.x))
}

/// Attitude after rotation by yaw about z, then pitch about the new y, then roll about the new x, radians, each
/// right-handed.
#[inline]
pub fn turned(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, yaw_rad, pitch_rad, roll_rad)
}

/// Maximum time in seconds and coordinate in metres; squares of these are far from overflow.
const LARGEST: f64 = 1e15;

/// Minimum time between points, seconds: that of light over 30 cm.
const MIN_STEP_S: f64 = 1e-9;

/// Check that times are finite and ascend by at least [`MIN_STEP_S`], that positions are finite and as many as times
/// (at least two), and that no speed exceeds that of light.
fn check_knots(times_s: &[f64], positions_m: &[DVec3]) -> Result<(), TrackError> {
    if times_s.len() != positions_m.len() || times_s.len() < 2 {
        return Err(TrackError(format!(
            "{} times and {} positions: expected equal numbers, at least two",
            times_s.len(),
            positions_m.len()
        )));
    }
    let finite = |(t, p): (&f64, &DVec3)| {
        t.abs() <= LARGEST && p.abs().max_element() <= LARGEST && !p.is_nan()
    };
    if let Some(n) = times_s.iter().zip(positions_m).position(|x| !finite(x)) {
        return Err(TrackError(format!(
            "point {} is at {:e} s, {} m: expected finite values of at most {LARGEST:e}",
            n + 1,
            times_s[n],
            positions_m[n]
        )));
    }
    match times_s.windows(2).position(|t| t[1] <= t[0]) {
        Some(n) => Err(TrackError(format!(
            "point {} is at {} s, but the previous one at {} s: expected ascending times",
            n + 2,
            times_s[n + 1],
            times_s[n]
        ))),
        None => check_speeds(times_s, positions_m),
    }
}

/// Check that no speed exceeds that of light and that times differ by [`MIN_STEP_S`] or more.
fn check_speeds(times_s: &[f64], positions_m: &[DVec3]) -> Result<(), TrackError> {
    let faster = |n: &usize| {
        let step_s = times_s[n + 1] - times_s[*n];
        let way_m = positions_m[*n].distance(positions_m[n + 1]);
        step_s < MIN_STEP_S || way_m > SPEED_OF_LIGHT_M_S * step_s
    };
    match (0..times_s.len() - 1).find(faster) {
        None => Ok(()),
        Some(n) => Err(TrackError(format!(
            "points {} and {} are {:.3e} s and {:.3e} m apart: closer in time than {MIN_STEP_S:e} s, or faster than light; correct the \
             unit of times, or leave one out",
            n + 1,
            n + 2,
            times_s[n + 1] - times_s[n],
            positions_m[n].distance(positions_m[n + 1])
        ))),
    }
}

/// Segment `n .. n + 1` of ascending `times_s` (at least two) that contains a time, or the first or last one.
fn piece(times_s: &[f64], time_s: f64) -> usize {
    times_s
        .partition_point(|&t| t <= time_s)
        .clamp(1, times_s.len() - 1)
        - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

    #[test]
    fn heading_follows_velocity_with_level_wings() {
        for velocity in [
            DVec3::new(3.0, 4.0, 0.0),
            DVec3::new(-3.0, 0.1, 2.0),
            DVec3::new(0.0, -9.0, -20.0),
            DVec3::Z,
        ] {
            let attitude = heading(velocity);
            assert!((attitude * DVec3::X).distance(velocity.normalize()) < 1e-15);
            assert!((attitude * DVec3::Y).z.abs() < 1e-15);
            assert!((attitude * DVec3::Z).z > -1e-15);
        }
        assert_eq!(heading(DVec3::ZERO), DQuat::IDENTITY);
    }

    #[test]
    fn rotations_are_right_handed_and_pitch_lowers_nose() {
        let nose = |r, p, y| turned(r, p, y) * DVec3::X;
        assert!(nose(1.0, 0.0, FRAC_PI_2).distance(DVec3::Y) < 1e-15);
        assert!((nose(0.0, FRAC_PI_6, 0.0).z + 0.5).abs() < 1e-15);
        // Roll lifts the left wing.
        assert!(((turned(FRAC_PI_6, 0.0, 1.0) * DVec3::Y).z - 0.5).abs() < 1e-15);
    }

    #[test]
    fn invalid_knots_are_refused() {
        let p = |n| vec![DVec3::ONE; n];
        let message = |t: &[f64], p: &[DVec3]| check_knots(t, p).unwrap_err().to_string();
        assert!(message(&[0.0], &p(1)).contains("at least two"));
        assert!(message(&[0.0, 1.0], &p(3)).contains("2 times and 3 positions"));
        assert!(message(&[0.0, f64::NAN], &p(2)).contains("point 2"));
        assert!(message(&[0.0, 1e300], &p(2)).contains("at most 1e15"));
        assert!(message(&[0.0, 1.0, 1.0], &p(3)).contains("point 3 is at 1 s"));
        assert!(message(&[0.0, 1.0, 1.0 + 1e-12], &p(3)).contains("points 2 and 3 are"));
        let far = [DVec3::ZERO, DVec3::X * 1e6];
        assert!(message(&[0.0, 1e-3], &far).contains("faster than light"));
        assert!(message(&[0.0, 5e-324], &p(2)).contains("points 1 and 2"));
        assert!(check_knots(&[0.0, 1.0], &p(2)).is_ok());
    }
}
