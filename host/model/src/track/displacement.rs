//! Displacement of a target over time.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Spline, TrackError};

/// Displacement of a target over time: at constant velocity, or along sampled positions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Displacement {
    /// Constant velocity, metres per second.
    Velocity(DVec3),
    /// Natural cubic spline through positions, straight before and after.
    Sampled(Spline),
}

impl Displacement {
    /// Displacement through `positions_m` at ascending `times_s`. The origin of the positions cancels.
    ///
    /// # Errors
    /// [`TrackError`] if there are fewer than two points, or their number or times are invalid.
    pub fn sampled(times_s: Vec<f64>, positions_m: &[DVec3]) -> Result<Self, TrackError> {
        Ok(Self::Sampled(Spline::new(times_s, positions_m)?))
    }

    /// Displacement from `from_s` to `to_s`, metres, and velocity at `to_s`, metres per second.
    pub fn between(&self, from_s: f64, to_s: f64) -> (DVec3, DVec3) {
        match self {
            Self::Velocity(velocity_m_s) => (velocity_m_s * (to_s - from_s), *velocity_m_s),
            Self::Sampled(positions) => {
                let (to_m, velocity_m_s) = positions.at(to_s);
                (to_m - positions.at(from_s).0, velocity_m_s)
            }
        }
    }

    /// First and last time of the sampled positions, seconds; `None` for constant velocity.
    pub fn span_s(&self) -> Option<[f64; 2]> {
        match self {
            Self::Velocity(_) => None,
            Self::Sampled(positions) => Some(positions.span_s()),
        }
    }
}

impl From<DVec3> for Displacement {
    fn from(velocity_m_s: DVec3) -> Self {
        Self::Velocity(velocity_m_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampled_constant_velocity_agrees_with_velocity() {
        let velocity = DVec3::new(3.0, -4.0, 0.5);
        let origin = DVec3::new(100.0, 20.0, -3.0);
        let times = [-1.0, 0.25, 2.0];
        let places = times.map(|t| origin + velocity * t);
        let sampled = Displacement::sampled(times.to_vec(), &places).unwrap();
        let constant = Displacement::from(velocity);
        for (from_s, to_s) in [(-1.0, 2.0), (0.3, 0.3), (1.9, -0.7)] {
            let (moved_m, m_s) = sampled.between(from_s, to_s);
            let (expected_m, expected_m_s) = constant.between(from_s, to_s);
            // Rounding of float64 at 100 m.
            assert!(moved_m.distance(expected_m) < 1e-13);
            assert!(m_s.distance(expected_m_s) < 1e-13);
        }
        assert_eq!(sampled.span_s(), Some([-1.0, 2.0]));
        assert_eq!(constant.span_s(), None);
    }

    #[test]
    fn displacement_survives_json_and_invalid_one_is_refused() {
        let places = [DVec3::ZERO, DVec3::X / 3.0, DVec3::Y];
        let sampled = Displacement::sampled(vec![0.0, 0.1, 0.7], &places).unwrap();
        for (one, text) in [
            (
                Displacement::from(DVec3::new(1.0, 2.0, 3.0)),
                "[1.0,2.0,3.0]",
            ),
            (sampled, "{\"times_s\":[0.0,0.1,0.7],\"positions_m\":[[0.0,"),
        ] {
            let json = serde_json::to_string(&one).unwrap();
            assert!(json.starts_with(text), "{json}");
            assert_eq!(serde_json::from_str::<Displacement>(&json).unwrap(), one);
        }
        let descending = "{\"times_s\":[1.0,0.0],\"positions_m\":[[0,0,0],[1,0,0]]}";
        assert!(serde_json::from_str::<Displacement>(descending).is_err());
    }
}
