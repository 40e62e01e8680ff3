//! Smooth curve through points passed at given times.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::cubic::Cubic;
use super::{TrackError, check_knots, heading};
use crate::track::{Pose, Trajectory};

/// Smooth curve through points passed at given times: a natural cubic spline with continuous acceleration, straight
/// before and after. The heading is along the velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Points", into = "Points")]
pub struct Spline {
    curve: Cubic<3>,
}

/// Points of a spline, its serialised form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Points {
    times_s: Vec<f64>,
    positions_m: Vec<DVec3>,
}

impl TryFrom<Points> for Spline {
    type Error = TrackError;

    fn try_from(points: Points) -> Result<Self, TrackError> {
        Self::new(points.times_s, &points.positions_m)
    }
}

impl From<Spline> for Points {
    fn from(spline: Spline) -> Self {
        let (times_s, positions_m) = spline.curve.points();
        Self {
            times_s: times_s.to_vec(),
            positions_m: positions_m.iter().map(|&place| place.into()).collect(),
        }
    }
}

impl Spline {
    /// Track through `positions_m` at ascending `times_s`.
    ///
    /// # Errors
    /// [`TrackError`] if there are fewer than two points, or their number or times are invalid.
    pub fn new(times_s: Vec<f64>, positions_m: &[DVec3]) -> Result<Self, TrackError> {
        check_knots(&times_s, positions_m)?;
        let values = positions_m.iter().map(DVec3::to_array).collect();
        Ok(Self {
            curve: Cubic::new(times_s, values),
        })
    }

    /// Time of the first and of the last point, seconds.
    pub fn span_s(&self) -> [f64; 2] {
        self.curve.span().into()
    }

    /// Position in metres and velocity in metres per second.
    pub fn at(&self, time_s: f64) -> (DVec3, DVec3) {
        let (position, velocity) = self.curve.at(time_s);
        (position.into(), velocity.into())
    }
}

impl Trajectory for Spline {
    fn pose(&self, time_s: f64) -> Pose {
        let (position_m, velocity) = self.at(time_s);
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
    fn finely_sampled_circle_is_followed() {
        let (radius, rate) = (100.0, 0.1);
        let circle = |t: f64| DVec3::new((rate * t).cos(), (rate * t).sin(), 0.5) * radius;
        let times: Vec<f64> = (0..101).map(f64::from).collect();
        let points: Vec<DVec3> = times.iter().map(|&t| circle(t)).collect();
        let track = Spline::new(times, &points).unwrap();
        for i in 0..100 {
            let t = 20.37 + f64::from(i) * 0.6;
            let (position, velocity) = track.at(t);
            // 5 / 384 r w^4 in each of two axes: 1.9e-4 m; the error of 0.125 m at the ends has decreased by 3.7^20.
            assert!(position.distance(circle(t)) < 1.9e-4);
            let nose = track.pose(t).attitude * DVec3::X;
            assert!(nose.distance(velocity.normalize()) < 1e-14);
        }
    }
}
