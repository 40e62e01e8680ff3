//! Carriage on a rail.

use glam::DVec3;

use super::heading;
use crate::track::{Pose, Trajectory};

/// Carriage that waits at one end of a rail, moves to the other at constant speed, and stops there.
///
/// Its heading is always along the rail. Its velocity jumps at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rail {
    /// Start of the rail, metres.
    pub from_m: DVec3,
    /// End of the rail, metres.
    pub to_m: DVec3,
    /// Speed, metres per second; positive.
    pub speed_m_s: f64,
    /// Start time, seconds.
    pub start_s: f64,
}

impl Trajectory for Rail {
    fn pose(&self, time_s: f64) -> Pose {
        let way = self.to_m - self.from_m;
        let gone_m = self.speed_m_s * (time_s - self.start_s).max(0.0);
        Pose {
            position_m: if gone_m < way.length() {
                self.from_m + way.normalize() * gone_m
            } else {
                self.to_m
            },
            attitude: heading(way),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carriage_waits_moves_and_stops() {
        let rail = Rail {
            from_m: DVec3::new(1.0, 0.0, 2.0),
            to_m: DVec3::new(1.0, 3.0, 6.0),
            speed_m_s: 0.5,
            start_s: 4.0,
        };
        let at = |t| rail.pose(t).position_m;
        assert_eq!(at(-100.0), rail.from_m);
        assert_eq!(at(4.0), rail.from_m);
        // 5 m long: 10 s; after 4 s, 2 m along (0, 0.6, 0.8).
        assert!(at(8.0).distance(DVec3::new(1.0, 1.2, 3.6)) < 1e-14);
        assert!(at(14.0 - 1e-9).distance(rail.to_m) < 1e-9);
        assert_eq!(at(15.0), rail.to_m);
        for t in [0.0, 8.0, 99.0] {
            let nose = rail.pose(t).attitude * DVec3::X;
            assert!(nose.distance(DVec3::new(0.0, 0.6, 0.8)) < 1e-15);
        }
    }

    #[test]
    fn rail_without_length_is_at_rest() {
        let rail = Rail {
            from_m: DVec3::ONE,
            to_m: DVec3::ONE,
            speed_m_s: 1.0,
            start_s: 0.0,
        };
        assert_eq!(rail.pose(1.0).position_m, DVec3::ONE);
    }
}
