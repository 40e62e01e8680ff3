//! Settings of the tracker.

use super::error::TrackerError;
use super::plane::Plane;

/// Settings of the tracker. Formulas are in the [module's documentation](crate::tracker).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Plane in which targets move. Default: horizontal at height 0.
    pub plane: Plane,
    /// Spectral density `q` of the white acceleration along each axis, m^2/s^3. A velocity component changes by `sqrt(q T)` in the time
    /// `T`. Default 0.5.
    pub acceleration_density_m2_s3: f64,
    /// Prior standard deviation of the tangential speed of a new track, metres per second. Default 10.
    pub tangential_deviation_m_s: f64,
    /// Probability of detection `P_D` of a target in a scan. Default 0.9.
    pub detection_probability: f64,
    /// Probability that a detection of the track's target lies in its gate. Default 0.999.
    pub gate_probability: f64,
    /// Density of false alarms `beta_FA` per scan, 1 / (m^2 m/s). Default 1e-7: 5 per square kilometre within 50 m/s.
    pub false_alarm_density: f64,
    /// Density of new targets `beta_NT` per scan, 1 / (m^2 m/s). Default 1e-9.
    pub new_target_density: f64,
    /// Probability `alpha` that a tentative track of false alarms is confirmed. Default 1e-4.
    pub false_confirmation_probability: f64,
    /// Probability `eps` that the track of a target is deleted, in a test. Default 1e-4: 4 misses in a row at `P_D = 0.9`.
    pub true_deletion_probability: f64,
    /// Largest number of tracks: tentative, confirmed and deleted. The earliest deleted track is discarded for a new one. Default 1000.
    pub max_tracks: usize,
    /// Largest number of tentative tracks. Default 500.
    pub max_tentative: usize,
    /// Largest number of detections in a scan. Default 2000.
    pub max_detections: usize,
    /// Largest number of history entries of a track, 184 bytes each. The earliest entry is discarded for a new one. Default 1000.
    pub max_history: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            plane: Plane::horizontal(0.0),
            acceleration_density_m2_s3: 0.5,
            tangential_deviation_m_s: 10.0,
            detection_probability: 0.9,
            gate_probability: 0.999,
            false_alarm_density: 1e-7,
            new_target_density: 1e-9,
            false_confirmation_probability: 1e-4,
            true_deletion_probability: 1e-4,
            max_tracks: 1000,
            max_tentative: 500,
            max_detections: 2000,
            max_history: 1000,
        }
    }
}

impl Settings {
    /// Score of a track's first detection.
    pub(super) fn first_score(&self) -> f64 {
        (self.new_target_density / self.false_alarm_density).ln()
    }

    /// Change of the score by a scan without a detection.
    pub(super) fn miss(&self) -> f64 {
        (1.0 - self.detection_probability).ln()
    }

    /// Change of the score by a detection with this `d^2 + ln det S`.
    pub(super) fn hit(&self, distance: f64) -> f64 {
        let density = self.false_alarm_density + self.new_target_density;
        let log_2_pi = std::f64::consts::TAU.ln();
        (self.detection_probability / density).ln() - 0.5 * (3.0 * log_2_pi + distance)
    }

    /// Rise of the score above that of the first detection at which a track is confirmed.
    pub(super) fn confirming_rise(&self) -> f64 {
        ((1.0 - self.true_deletion_probability) / self.false_confirmation_probability).ln()
    }

    /// Fall of the score at which a track is deleted: below the first score if tentative, below the highest if confirmed.
    pub(super) fn deleting_fall(&self) -> f64 {
        ((1.0 - self.false_confirmation_probability) / self.true_deletion_probability).ln()
    }

    /// Check the range of every setting.
    pub(super) fn check(&self) -> Result<(), TrackerError> {
        let Plane {
            origin_m,
            x_axis,
            y_axis,
        } = self.plane;
        let (x_length, y_length, product) = (x_axis.length(), y_axis.length(), x_axis.dot(y_axis));
        let off = [x_length - 1.0, y_length - 1.0, product];
        if !(origin_m.is_finite() && off.iter().all(|off| off.abs() < 1e-9)) {
            return Err(TrackerError::Plane {
                x_length,
                y_length,
                product,
            });
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let probability = |value: f64| value > 0.0 && value < 1.0;
        let small = |value: f64| value > 0.0 && value < 0.5;
        const POSITIVE: &str = "a finite value above 0";
        const PROBABILITY: &str = "a probability between 0 and 1, both excluded";
        const SMALL: &str = "a probability above 0 and below 0.5";
        const COUNT: &str = "at least 1";
        let density = self.acceleration_density_m2_s3;
        let checked = [
            (
                "acceleration_density_m2_s3",
                density,
                density == 0.0 || positive(density),
                "a finite value of at least 0 m^2/s^3",
            ),
            (
                "tangential_deviation_m_s",
                self.tangential_deviation_m_s,
                positive(self.tangential_deviation_m_s),
                POSITIVE,
            ),
            (
                "detection_probability",
                self.detection_probability,
                probability(self.detection_probability),
                PROBABILITY,
            ),
            (
                "gate_probability",
                self.gate_probability,
                probability(self.gate_probability),
                PROBABILITY,
            ),
            (
                "false_alarm_density",
                self.false_alarm_density,
                positive(self.false_alarm_density),
                POSITIVE,
            ),
            (
                "new_target_density",
                self.new_target_density,
                positive(self.new_target_density),
                POSITIVE,
            ),
            (
                "false_confirmation_probability",
                self.false_confirmation_probability,
                small(self.false_confirmation_probability),
                SMALL,
            ),
            (
                "true_deletion_probability",
                self.true_deletion_probability,
                small(self.true_deletion_probability),
                SMALL,
            ),
        ];
        let counts = [
            ("max_tracks", self.max_tracks),
            ("max_tentative", self.max_tentative),
            ("max_detections", self.max_detections),
            ("max_history", self.max_history),
        ];
        let counts = counts.map(|(name, count)| (name, count as f64, count > 0, COUNT));
        for (name, found, accepted, expected) in checked.into_iter().chain(counts) {
            if !accepted {
                return Err(TrackerError::Setting {
                    name,
                    expected,
                    found,
                });
            }
        }
        Ok(())
    }
}
