//! Perturbed tracks: sway, vibration, acceleration, wobble.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;

use super::{SmoothRandom, TrackError, turned};
use subaperture_model::track::{Pose, Trajectory};

/// Random stream of the first sway; each sway uses one stream from here on.
const SWAY: u64 = u64::from_be_bytes(*b"sway\0\0\0\0");

/// Perturbation of a track. Displacements are along the scene's axes and do not rotate the body.
#[derive(Clone, Debug, PartialEq)]
pub enum Perturbation {
    /// Smooth random displacement.
    Sway(SmoothRandom),
    /// Displacement `amplitude_m sin(2 pi frequency_hz t + phase_rad)`.
    Vibration {
        /// Amplitude, metres.
        amplitude_m: DVec3,
        /// Frequency, hertz.
        frequency_hz: f64,
        /// Phase at time 0, radians.
        phase_rad: f64,
    },
    /// Constant acceleration from a given time: displacement `acceleration_m_s2 (t - from_s)^2 / 2` for `t > from_s`.
    Acceleration {
        /// Acceleration, metres per second squared.
        acceleration_m_s2: DVec3,
        /// Start time, seconds.
        from_s: f64,
    },
    /// Rotation of the body by `amplitude_rad sin(2 pi t / period_s + phase_rad)` about its own axes.
    Wobble {
        /// Amplitudes of roll, pitch and yaw, radians.
        amplitude_rad: DVec3,
        /// Period, seconds.
        period_s: f64,
        /// Phase at time 0, radians.
        phase_rad: f64,
    },
}

impl Perturbation {
    /// Make a sway with a given RMS per axis (metres) and correlation time (seconds). Sways with one seed and different
    /// `index` are independent.
    ///
    /// # Errors
    /// [`TrackError`] if the RMS is not finite or the time is not positive.
    pub fn sway(
        rms_m: DVec3,
        correlation_s: f64,
        seed: u64,
        index: u32,
    ) -> Result<Self, TrackError> {
        if !(rms_m.is_finite() && correlation_s > 0.0 && correlation_s.is_finite()) {
            return Err(TrackError(format!(
                "sway of {rms_m} m with a correlation time of {correlation_s} s: expected finite lengths and a \
                                positive time"
            )));
        }
        let kind = SWAY + u64::from(index);
        Ok(Self::Sway(SmoothRandom::new(
            rms_m,
            correlation_s,
            seed,
            kind,
        )))
    }
}

/// Track with perturbations applied one after another.
///
/// All perturbations have continuous velocities, so that the result is as smooth as the underlying track. Evaluation at
/// any time costs 0.1 to 1 microseconds per perturbation.
#[derive(Clone, Debug)]
pub struct Perturbed {
    /// Track to which the perturbations are added.
    pub track: Arc<dyn Trajectory>,
    /// Perturbations in order of application.
    pub perturbations: Vec<Perturbation>,
}

impl Trajectory for Perturbed {
    fn pose(&self, time_s: f64) -> Pose {
        let mut pose = self.track.pose(time_s);
        for perturbation in &self.perturbations {
            match *perturbation {
                Perturbation::Sway(ref sway) => pose.position_m += sway.at(time_s),
                Perturbation::Vibration {
                    amplitude_m,
                    frequency_hz,
                    phase_rad,
                } => {
                    pose.position_m +=
                        amplitude_m * libm::sin(TAU * frequency_hz * time_s + phase_rad);
                }
                Perturbation::Acceleration {
                    acceleration_m_s2,
                    from_s,
                } => {
                    let since_s = (time_s - from_s).max(0.0);
                    pose.position_m += acceleration_m_s2 * (since_s * since_s / 2.0);
                }
                Perturbation::Wobble {
                    amplitude_rad,
                    period_s,
                    phase_rad,
                } => {
                    let angles = amplitude_rad * libm::sin(TAU * time_s / period_s + phase_rad);
                    pose.attitude *= turned(angles.x, angles.y, angles.z);
                }
            }
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::track::Linear;

    fn with(perturbations: Vec<Perturbation>) -> Perturbed {
        let track = Arc::new(Linear {
            position_m: DVec3::ZERO,
            velocity_m_s: DVec3::new(0.0, 50.0, 0.0),
            at_s: 0.0,
        });
        Perturbed {
            track,
            perturbations,
        }
    }

    #[test]
    fn vibration_and_acceleration_add_along_scene_axes() {
        let track = with(vec![
            Perturbation::Vibration {
                amplitude_m: DVec3::new(1e-3, 0.0, 2e-3),
                frequency_hz: 25.0,
                phase_rad: 0.0,
            },
            Perturbation::Acceleration {
                acceleration_m_s2: DVec3::new(0.2, 0.0, 0.0),
                from_s: 1.0,
            },
        ]);
        let off = |t: f64| track.pose(t).position_m - DVec3::new(0.0, 50.0 * t, 0.0);
        // A quarter period of 25 Hz is 10 ms.
        assert!(off(0.01).distance(DVec3::new(1e-3, 0.0, 2e-3)) < 1e-14);
        // Whole periods at 4 s; 0.2 * 3^2 / 2 = 0.9 m.
        assert!(off(4.0).distance(DVec3::new(0.9, 0.0, 0.0)) < 1e-13);
        assert!(off(-4.0).length() < 1e-13);
    }

    #[test]
    fn wobble_rotates_body_about_its_own_axes() {
        let track = with(vec![Perturbation::Wobble {
            amplitude_rad: DVec3::new(0.0, 0.1, 0.0),
            period_s: 8.0,
            phase_rad: 0.0,
        }]);
        // After a quarter period the nose, along scene y, points 0.1 rad down.
        let nose = track.pose(2.0).attitude * DVec3::X;
        assert!(nose.distance(DVec3::new(0.0, 0.1f64.cos(), -(0.1f64.sin()))) < 1e-14);
        assert_eq!(track.pose(2.0).position_m, DVec3::new(0.0, 100.0, 0.0));
    }

    #[test]
    fn perturbed_position_and_velocity_are_continuous() {
        let rms = DVec3::splat(0.05);
        let track = with(vec![
            Perturbation::sway(rms, 2.0, 7, 0).unwrap(),
            Perturbation::sway(rms, 0.5, 7, 1).unwrap(),
            Perturbation::Vibration {
                amplitude_m: DVec3::splat(1e-4),
                frequency_hz: 20.0,
                phase_rad: 0.4,
            },
            Perturbation::Acceleration {
                acceleration_m_s2: DVec3::splat(0.3),
                from_s: 1.0,
            },
        ]);
        let velocity = |t: f64| {
            let h = 1e-5;
            (track.pose(t + h).position_m - track.pose(t - h).position_m) / (2.0 * h)
        };
        // Accelerations per axis: the fast sway has 0.05 * 5.7 w^2 with w below 3 sigma, 3 sqrt 2 / 0.5 = 8.5 / s: 20.6
        // m/s^2; the slow one 1.3; vibration 1e-4 (2 pi 20)^2 = 1.6; constant 0.3. The total is below 25 per axis, 44
        // m/s^2 in three axes. Over 0.1 ms: 4.4e-3 m/s; differences are rounded to 1e-14 m / 2e-5 s.
        let mut largest: f64 = 0.0;
        for i in 0..20_000 {
            let t = f64::from(i) * 1e-4;
            largest = largest.max(velocity(t).distance(velocity(t + 1e-4)));
        }
        assert!(largest < 4.4e-3, "{largest}");
        // The two sways differ.
        let [Perturbation::Sway(a), Perturbation::Sway(b)] = &track.perturbations[..2] else {
            panic!("two sways first");
        };
        assert_ne!(a.at(0.0), b.at(0.0));
        assert!(Perturbation::sway(rms, 0.0, 7, 0).is_err());
    }
}
