//! Antenna on a swinging arm.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::track::{Pose, Trajectory};

/// Level arm that swings back and forth about a pivot at constant angular rate, with the antenna at its end looking
/// outwards: the body's x axis is along the arm.
///
/// At `start_s` the arm is at `from_rad`, moving towards `to_rad`. It swings at all times; its velocity jumps at both
/// ends of the swing. The ends may be more than a turn apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Pivot, at the antenna's height, metres.
    pub pivot_m: DVec3,
    /// Length of the arm, metres.
    pub radius_m: f64,
    /// One end of the swing: angle from x towards y, radians.
    pub from_rad: f64,
    /// Other end of the swing, radians; may be smaller.
    pub to_rad: f64,
    /// Angular rate, radians per second; positive.
    pub rate_rad_s: f64,
    /// Time at which the arm is at `from_rad`, seconds.
    pub start_s: f64,
}

impl Arc {
    /// Angle of the arm at a time, radians.
    pub fn angle_rad(&self, time_s: f64) -> f64 {
        let swing = self.to_rad - self.from_rad;
        if swing == 0.0 {
            return self.from_rad;
        }
        // One period is both directions; the second half runs backwards.
        let round = 2.0 * swing.abs();
        let gone = (self.rate_rad_s * (time_s - self.start_s)).rem_euclid(round);
        self.from_rad + gone.min(round - gone).copysign(swing)
    }
}

impl Trajectory for Arc {
    fn pose(&self, time_s: f64) -> Pose {
        // A quaternion has twice the period; wrap, so that equal arm angles give equal poses.
        let angle = self.angle_rad(time_s).rem_euclid(2.0 * PI);
        let (sin, cos) = libm::sincos(angle);
        Pose {
            position_m: self.pivot_m + DVec3::new(cos, sin, 0.0) * self.radius_m,
            attitude: DQuat::from_rotation_z(angle),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm() -> Arc {
        Arc {
            pivot_m: DVec3::new(0.0, 0.0, 1.5),
            radius_m: 0.2,
            from_rad: 0.5,
            to_rad: -2.5,
            rate_rad_s: 0.1,
            start_s: 2.0,
        }
    }

    #[test]
    fn arm_swings_between_its_ends_at_its_rate() {
        let angle = |t| arm().angle_rad(t);
        // 3 rad at 0.1 rad/s: 30 s one way.
        for (t, expected) in [
            (2.0, 0.5),
            (12.0, -0.5),
            (32.0, -2.5),
            (42.0, -1.5),
            (62.0, 0.5),
            (72.0, -0.5),
            (-8.0, -0.5),
        ] {
            assert!((angle(t) - expected).abs() < 1e-12, "{t}");
        }
        // Continuous at both ends.
        for turn in [2.0, 32.0, 62.0] {
            assert!((angle(turn + 1e-6) - angle(turn - 1e-6)).abs() < 1e-12);
        }
        let still = Arc {
            to_rad: 0.5,
            ..arm()
        };
        assert_eq!(still.angle_rad(9.0), 0.5);
    }

    #[test]
    fn antenna_looks_outwards_from_end_of_arm() {
        for i in 0..60 {
            let pose = arm().pose(f64::from(i));
            let outwards = pose.position_m - arm().pivot_m;
            assert!((outwards.length() - 0.2).abs() < 1e-15);
            assert!((pose.attitude * DVec3::X).distance(outwards / 0.2) < 1e-14);
        }
    }
}
