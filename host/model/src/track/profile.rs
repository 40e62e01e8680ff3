//! Motion in segments of constant acceleration.

use glam::DVec3;

use super::{TrackError, heading};
use crate::track::{Pose, Trajectory};

/// Consecutive segments of constant acceleration, with constant velocity before and after. Position and velocity are
/// continuous. The heading is along the velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Start of each segment; the last entry is the motion after all of them.
    pieces: Vec<Piece>,
    /// Velocity before the first segment.
    before_m_s: DVec3,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    from_s: f64,
    position_m: DVec3,
    velocity_m_s: DVec3,
    acceleration_m_s2: DVec3,
}

impl Profile {
    /// Create a profile that is at `position_m` with `velocity_m_s` at `start_s`, followed by each of `pieces`
    /// (duration in seconds, acceleration in metres per second squared).
    ///
    /// # Errors
    /// [`TrackError`] for a duration that is not positive, or a value that is not finite.
    pub fn new(
        start_s: f64,
        position_m: DVec3,
        velocity_m_s: DVec3,
        pieces: &[(f64, DVec3)],
    ) -> Result<Self, TrackError> {
        if !(start_s.is_finite() && position_m.is_finite() && velocity_m_s.is_finite()) {
            return Err(TrackError(format!(
                "profile start at {start_s} s, {position_m} m, {velocity_m_s} m/s: expected finite values"
            )));
        }
        let mut now = Piece {
            from_s: start_s,
            position_m,
            velocity_m_s,
            acceleration_m_s2: DVec3::ZERO,
        };
        let mut begun = Vec::with_capacity(pieces.len() + 1);
        for (n, &(duration_s, acceleration_m_s2)) in pieces.iter().enumerate() {
            if !(duration_s > 0.0 && duration_s.is_finite() && acceleration_m_s2.is_finite()) {
                return Err(TrackError(format!(
                    "segment {} of a profile lasts {duration_s} s at {acceleration_m_s2} m/s^2: give a \
                     positive duration and a finite acceleration",
                    n + 1
                )));
            }
            now.acceleration_m_s2 = acceleration_m_s2;
            begun.push(now);
            let (position_m, velocity_m_s) = now.at(now.from_s + duration_s);
            now = Piece {
                from_s: now.from_s + duration_s,
                position_m,
                velocity_m_s,
                acceleration_m_s2: DVec3::ZERO,
            };
        }
        begun.push(now);
        Ok(Self {
            pieces: begun,
            before_m_s: velocity_m_s,
        })
    }
}

impl Piece {
    fn at(&self, time_s: f64) -> (DVec3, DVec3) {
        let t = time_s - self.from_s;
        let velocity = self.velocity_m_s + self.acceleration_m_s2 * t;
        let position = self.position_m + (self.velocity_m_s + velocity) * (t / 2.0);
        (position, velocity)
    }
}

impl Trajectory for Profile {
    fn pose(&self, time_s: f64) -> Pose {
        let begun = self.pieces.partition_point(|p| p.from_s <= time_s);
        let (position_m, velocity) = match begun.checked_sub(1) {
            Some(n) => self.pieces[n].at(time_s),
            None => {
                let first = self.pieces[0];
                let before_s = time_s - first.from_s;
                (
                    first.position_m + self.before_m_s * before_s,
                    self.before_m_s,
                )
            }
        };
        Pose {
            position_m,
            attitude: heading(velocity),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn car_brakes_and_starts_again() {
        // 20 m/s along x, braked by 4 m/s^2 for 5 s (50 m, then at rest), then 2 m/s^2 along y for 3 s (9 m, 6 m/s).
        let car = Profile::new(
            1.0,
            DVec3::ZERO,
            DVec3::new(20.0, 0.0, 0.0),
            &[
                (5.0, DVec3::new(-4.0, 0.0, 0.0)),
                (3.0, DVec3::new(0.0, 2.0, 0.0)),
            ],
        )
        .unwrap();
        let at = |t| car.pose(t).position_m;
        for (t, x, y) in [
            (0.0, -20.0, 0.0),
            (1.0, 0.0, 0.0),
            (3.0, 32.0, 0.0),
            (6.0, 50.0, 0.0),
            (7.0, 50.0, 1.0),
            (9.0, 50.0, 9.0),
            (11.0, 50.0, 21.0),
        ] {
            assert!(at(t).distance(DVec3::new(x, y, 0.0)) < 1e-13, "{t}");
        }
        // Velocity is continuous: on both sides of a joint it differs by the acceleration times 1e-4 s.
        for joint in [1.0, 6.0, 9.0] {
            let h = 1e-4;
            let jump = (at(joint + h) - at(joint)) / h - (at(joint) - at(joint - h)) / h;
            assert!(jump.length() < 4.0 * h + 1e-9);
        }
    }

    #[test]
    fn invalid_segments_are_refused() {
        let new = |pieces| Profile::new(0.0, DVec3::ZERO, DVec3::X, pieces);
        let error = new(&[(1.0, DVec3::X), (0.0, DVec3::X)]).unwrap_err();
        assert!(error.to_string().contains("segment 2"));
        assert!(new(&[(1.0, DVec3::NAN)]).is_err());
        assert!(Profile::new(f64::NAN, DVec3::ZERO, DVec3::X, &[]).is_err());
    }
}
