//! Scans and detections: the input of the tracker.

use glam::DVec3;
use subaperture_signal::dense::fixed::{Matrix, factor};

use super::error::TrackerError;
use crate::target::Target;

/// Least fraction of a variance that the variables before it leave unexplained.
const LEAST_PIVOT: f64 = 1e-12;

/// Relative difference of two elements of a covariance that counts as symmetric.
const SYMMETRY: f64 = 1e-9;

/// Detections of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Time of the detections, seconds. Scans have ascending times.
    pub time_s: f64,
    /// Position of the radar at that time, metres in the scene frame.
    pub sensor_m: DVec3,
    /// Velocity of the radar, metres per second. A fold of a radial velocity moves the position by it; zero for positions that do not depend
    /// on the radial velocity (real aperture).
    pub sensor_velocity_m_s: DVec3,
    /// Detections in any order.
    pub detections: Vec<Detection>,
}

/// Detection with position and radial velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Position, metres in the scene frame. Its component along the plane's normal is ignored.
    pub position_m: DVec3,
    /// Velocity along the line of sight, metres per second, positive when approaching.
    pub radial_velocity_m_s: f64,
    /// Covariance of `(x, y, v_r)`, with x and y along the axes of the tracker's plane: m^2, m * m/s and (m/s)^2.
    pub covariance: [[f64; 3]; 3],
    /// Interval of radial velocities without ambiguity, metres per second. `None` for unambiguous velocities.
    pub velocity_ambiguity_m_s: Option<f64>,
}

impl Detection {
    /// Detection from an estimated target. `None` for a target without a position, or without positive variances.
    ///
    /// The position has the covariance [`Target::covariance_m2`], of errors of radial velocity, range and place in the image. Only the first is correlated with the
    /// radial velocity: [`Target::position_velocity_covariance`].
    pub fn of(target: &Target) -> Option<Self> {
        let [[xx, xy], [yx, yy]] = target.covariance_m2?;
        let [xv, yv] = target.position_velocity_covariance?;
        let vv = target.velocity_deviation_m_s * target.velocity_deviation_m_s;
        let covariance = [[xx, xy, xv], [yx, yy, yv], [xv, yv, vv]];
        let detection = Self {
            position_m: target.position_m?.into(),
            radial_velocity_m_s: target.radial_velocity_m_s,
            covariance,
            velocity_ambiguity_m_s: Some(target.velocity_ambiguity_m_s),
        };
        detection.check(0).is_ok().then_some(detection)
    }

    /// Check all values of the detection with this index.
    fn check(&self, index: usize) -> Result<(), TrackerError> {
        let named = [
            ("position_m.x", self.position_m.x),
            ("position_m.y", self.position_m.y),
            ("position_m.z", self.position_m.z),
            ("radial_velocity_m_s", self.radial_velocity_m_s),
        ];
        if let Some((name, found)) = named.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(TrackerError::NotFinite { index, name, found });
        }
        let covariance = self.covariance;
        if !positive_definite(&covariance) {
            return Err(TrackerError::Covariance { index, covariance });
        }
        match self.velocity_ambiguity_m_s {
            Some(found) if !(found > 0.0 && found.is_finite()) => {
                Err(TrackerError::Ambiguity { index, found })
            }
            _ => Ok(()),
        }
    }
}

impl Scan {
    /// Check the scan after a scan at `last_s`, with at most `max_detections`.
    pub(super) fn check(&self, last_s: f64, max_detections: usize) -> Result<(), TrackerError> {
        if !(self.time_s.is_finite() && self.time_s > last_s) {
            return Err(TrackerError::Time {
                last_s,
                time_s: self.time_s,
            });
        }
        if !self.sensor_m.is_finite() {
            return Err(TrackerError::Sensor(self.sensor_m.to_array()));
        }
        if !self.sensor_velocity_m_s.is_finite() {
            let velocity_m_s = self.sensor_velocity_m_s.to_array();
            return Err(TrackerError::SensorVelocity(velocity_m_s));
        }
        if self.detections.len() > max_detections {
            return Err(TrackerError::Detections {
                allowed: max_detections,
                found: self.detections.len(),
            });
        }
        let mut detections = self.detections.iter().enumerate();
        detections.try_for_each(|(index, detection)| detection.check(index))
    }
}

/// Whether a matrix is finite, symmetric and positive definite.
fn positive_definite(matrix: &Matrix<3, 3>) -> bool {
    let scale = |i: usize, j: usize| (matrix[i][i] * matrix[j][j]).abs().sqrt();
    let symmetric =
        |(i, j): (usize, usize)| (matrix[i][j] - matrix[j][i]).abs() <= SYMMETRY * scale(i, j);
    matrix.as_flattened().iter().all(|value| value.is_finite())
        && [(0, 1), (0, 2), (1, 2)].into_iter().all(symmetric)
        && factor(matrix, LEAST_PIVOT).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Target at 5 km of a radar at 125 m/s along x: a velocity error of 0.1 m/s moves it by -4 m along x.
    fn target() -> Target {
        Target {
            time_s: 1.0,
            image_pixel: [0.0; 2],
            image_position_m: [200.0, 0.0, 0.0],
            position_m: Some([0.0, 0.5, 0.0]),
            covariance_m2: Some([[16.25, 0.0], [0.0, 0.25]]),
            position_velocity_covariance: Some([-0.4, 0.0]),
            radial_velocity_m_s: 5.0,
            velocity_deviation_m_s: 0.1,
            velocity_ambiguity_m_s: 7.5,
            cross_range: None,
            velocity_m_s: None,
            acceleration_m_s2: None,
            ground_speed_m_s: 5.1,
            snr_db: 20.0,
            extent_m: 1.0,
            num_pixels: 9,
        }
    }

    #[test]
    fn covariance_of_target_has_cross_terms() {
        let detection = Detection::of(&target()).unwrap();
        let wanted = [[16.25, 0.0, -0.4], [0.0, 0.25, 0.0], [-0.4, 0.0, 0.01]];
        for (row, wanted) in detection.covariance.iter().zip(wanted) {
            for (value, wanted) in row.iter().zip(wanted) {
                assert!((value - wanted).abs() < 1e-12, "{detection:?}");
            }
        }
        assert_eq!(detection.velocity_ambiguity_m_s, Some(7.5));
    }

    #[test]
    fn target_without_position_or_variance_has_no_detection() {
        let mut other = target();
        other.position_m = None;
        assert_eq!(Detection::of(&other), None);
        let mut other = target();
        other.covariance_m2 = None;
        assert_eq!(Detection::of(&other), None);
        let mut other = target();
        other.velocity_deviation_m_s = 0.0;
        assert_eq!(Detection::of(&other), None);
        let mut other = target();
        other.covariance_m2 = Some([[f64::NAN; 2]; 2]);
        assert_eq!(Detection::of(&other), None);
    }

    #[test]
    fn indefinite_and_asymmetric_covariances_are_refused() {
        assert!(positive_definite(&[
            [4.0, 1.0, 0.5],
            [1.0, 2.0, 0.0],
            [0.5, 0.0, 1.0]
        ]));
        assert!(!positive_definite(&[
            [4.0, 1.1, 0.5],
            [1.0, 2.0, 0.0],
            [0.5, 0.0, 1.0]
        ]));
        assert!(!positive_definite(&[
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 1.0]
        ]));
        assert!(!positive_definite(&[
            [1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0]
        ]));
    }
}
