//! Straight line at constant speed.

use glam::DVec3;

use super::heading;
use crate::track::{Pose, Trajectory};

/// Straight line at constant speed, for all times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Position at `at_s`, metres.
    pub position_m: DVec3,
    /// Velocity, metres per second.
    pub velocity_m_s: DVec3,
    /// Time of `position_m`, seconds.
    pub at_s: f64,
}

impl Trajectory for Linear {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            position_m: self.position_m + self.velocity_m_s * (time_s - self.at_s),
            attitude: heading(self.velocity_m_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_track_follows_its_velocity() {
        let track = Linear {
            position_m: DVec3::new(1.0, 2.0, 3.0),
            velocity_m_s: DVec3::new(0.0, 50.0, 0.0),
            at_s: 10.0,
        };
        let pose = track.pose(8.0);
        assert_eq!(pose.position_m, DVec3::new(1.0, -98.0, 3.0));
        assert!(pose.point_m(DVec3::X).distance(DVec3::new(1.0, -97.0, 3.0)) < 1e-12);
    }
}
