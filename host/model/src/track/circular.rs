//! Level circle at constant speed.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};

use crate::track::{Pose, Trajectory};

/// Level circle: `centre + radius (cos a, sin a, 0)` with `a = start_rad + rate_rad_s t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circular {
    /// Centre, at the track's height, metres.
    pub centre_m: DVec3,
    /// Radius, metres.
    pub radius_m: f64,
    /// Angle from x towards y at time 0, radians.
    pub start_rad: f64,
    /// Angular rate, radians per second; negative for clockwise seen from above.
    pub rate_rad_s: f64,
}

impl Trajectory for Circular {
    fn pose(&self, time_s: f64) -> Pose {
        let angle = self.start_rad + self.rate_rad_s * time_s;
        let (sin, cos) = libm::sincos(angle);
        Pose {
            position_m: self.centre_m + DVec3::new(cos, sin, 0.0) * self.radius_m,
            // Along the tangent, in the direction of motion.
            attitude: DQuat::from_rotation_z(angle + FRAC_PI_2.copysign(self.rate_rad_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circle_has_constant_radius_and_speed_and_tangential_heading() {
        for rate in [0.02, -0.05] {
            let track = Circular {
                centre_m: DVec3::new(10.0, -20.0, 7000.0),
                radius_m: 8000.0,
                start_rad: 0.3,
                rate_rad_s: rate,
            };
            for i in 0..50 {
                let t = f64::from(i) * 7.3 - 100.0;
                let pose = track.pose(t);
                assert!((pose.position_m.distance(track.centre_m) - 8000.0).abs() < 1e-9);
                assert_eq!(pose.position_m.z, 7000.0);
                // Central difference over 2 ms: error r w^3 h^2 / 6 < 2e-7 m/s, and rounding 2e-12 m / 2e-3 s.
                let h = 1e-3;
                let moved = track.pose(t + h).position_m - track.pose(t - h).position_m;
                let velocity = moved / (2.0 * h);
                assert!((velocity.length() - 8000.0 * rate.abs()).abs() < 1e-6);
                assert!((pose.attitude * DVec3::X).distance(velocity.normalize()) < 1e-8);
                assert!((pose.attitude * DVec3::Z).distance(DVec3::Z) < 1e-15);
            }
        }
    }
}
