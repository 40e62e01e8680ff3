//! Straight segments between points passed at given times.

use glam::DVec3;

use super::{TrackError, check_knots, heading, piece};
use crate::track::{Pose, Trajectory};

/// Straight segments between points passed at given times. Before the first point and after the last, the motion of
/// the first and last segment continues.
///
/// Velocity and heading jump at the points. While the body waits (two equal points), it keeps its last heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Waypoints {
    times_s: Vec<f64>,
    positions_m: Vec<DVec3>,
    /// Velocity that determines the heading on a segment: its own, or that of the nearest earlier segment with
    /// motion.
    courses: Vec<DVec3>,
}

impl Waypoints {
    /// Track through `positions_m` at ascending `times_s`.
    ///
    /// # Errors
    /// [`TrackError`] if there are fewer than two points, or their number or times are invalid.
    pub fn new(times_s: Vec<f64>, positions_m: Vec<DVec3>) -> Result<Self, TrackError> {
        check_knots(&times_s, &positions_m)?;
        let mut course = DVec3::ZERO;
        let courses = positions_m
            .windows(2)
            .map(|p| {
                if p[0] != p[1] {
                    course = p[1] - p[0];
                }
                course
            })
            .collect();
        Ok(Self {
            times_s,
            positions_m,
            courses,
        })
    }
}

impl Trajectory for Waypoints {
    fn pose(&self, time_s: f64) -> Pose {
        let n = piece(&self.times_s, time_s);
        let (from_s, to_s) = (self.times_s[n], self.times_s[n + 1]);
        let way = self.positions_m[n + 1] - self.positions_m[n];
        Pose {
            position_m: self.positions_m[n] + way * ((time_s - from_s) / (to_s - from_s)),
            attitude: heading(self.courses[n]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn track_passes_its_points_waits_and_continues() {
        let p = [(0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (10.0, 6.0)];
        let positions: Vec<DVec3> = p.iter().map(|&(x, y)| DVec3::new(x, y, 1.0)).collect();
        let times = vec![0.0, 5.0, 7.0, 9.0];
        let track = Waypoints::new(times.clone(), positions.clone()).unwrap();
        for (t, p) in times.iter().zip(&positions) {
            assert!(track.pose(*t).position_m.distance(*p) < 1e-14);
            // Continuous: 3 m/s at most.
            let apart = track
                .pose(t + 1e-9)
                .position_m
                .distance(track.pose(t - 1e-9).position_m);
            assert!(apart < 7e-9);
        }
        let at = |t| track.pose(t).position_m;
        assert!(at(-1.0).distance(DVec3::new(-2.0, 0.0, 1.0)) < 1e-14);
        assert!(at(6.0).distance(positions[1]) < 1e-14);
        assert!(at(10.0).distance(DVec3::new(10.0, 9.0, 1.0)) < 1e-14);
        let nose = |t| track.pose(t).attitude * DVec3::X;
        assert!(nose(2.0).distance(DVec3::X) < 1e-15);
        assert!(nose(6.0).distance(DVec3::X) < 1e-15);
        assert!(nose(8.0).distance(DVec3::Y) < 1e-15);
    }
}
