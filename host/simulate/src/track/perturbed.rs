//! A track with what disturbs it: sway, vibration, acceleration, wobble.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;

use super::{SmoothRandom, TrackError, turned};
use subaperture_model::track::{Pose, Trajectory};

/// Stream of random numbers for sways; each takes one from here on.
const SWAY: u64 = u64::from_be_bytes(*b"sway\0\0\0\0");

/// A disturbance of a track. Displacements are along the scene's axes and do not turn the body.
#[derive(Clone, Debug, PartialEq)]
pub enum Perturbation {
    /// Smooth random displacement.
    Sway(SmoothRandom),
    /// A displacement `amplitude_m sin(2 pi frequency_hz t + phase_rad)`.
    Vibration {
        /// Amplitude, metres.
        amplitude_m: DVec3,
        /// Frequency, hertz.
        frequency_hz: f64,
        /// Phase at time 0, radians.
        phase_rad: f64,
    },
    /// A constant acceleration that sets in: `acceleration_m_s2 (t - from_s)^2 / 2` from then on.
    Acceleration {
        /// The acceleration, metres a second squared.
        acceleration_m_s2: DVec3,
        /// When it sets in, seconds.
        from_s: f64,
    },
    /// A turn of the body by `amplitude_rad sin(2 pi t / period_s + phase_rad)` about its own axes.
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
    /// A sway of given RMS an axis (metres) and correlation time. Sways of one seed and different `index` are
    /// independent.
    ///
    /// # Errors
    /// [`TrackError`] if the RMS is not finite or the time not positive.
    pub fn sway(
        rms_m: DVec3,
        correlation_s: f64,
        seed: u64,
        index: u32,
    ) -> Result<Self, TrackError> {
        if !(rms_m.is_finite() && correlation_s > 0.0 && correlation_s.is_finite()) {
            return Err(TrackError(format!(
                "sway of {rms_m} m with a correlation time of {correlation_s} s; give finite lengths and a \
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

/// A track and what disturbs it, one after another.
///
/// All disturbances have continuous velocities, so the sum is as smooth as the track within. They can be
/// asked for at any time at the same cost: 0.1 to 1 microseconds each.
#[derive(Clone, Debug)]
pub struct Perturbed {
    /// The track within.
    pub track: Arc<dyn Trajectory>,
    /// What disturbs it.
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
    fn vibration_and_acceleration_add_up_along_the_scenes_axes() {
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
    fn wobble_turns_the_body_about_its_own_axes() {
        let track = with(vec![Perturbation::Wobble {
            amplitude_rad: DVec3::new(0.0, 0.1, 0.0),
            period_s: 8.0,
            phase_rad: 0.0,
        }]);
        // After a quarter period the nose, along scene y, is 0.1 rad down.
        let nose = track.pose(2.0).attitude * DVec3::X;
        assert!(nose.distance(DVec3::new(0.0, 0.1f64.cos(), -(0.1f64.sin()))) < 1e-14);
        assert_eq!(track.pose(2.0).position_m, DVec3::new(0.0, 100.0, 0.0));
    }

    #[test]
    fn position_and_velocity_are_continuous_for_the_phase_from_pulse_to_pulse() {
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
        // Accelerations an axis: sway 0.05 * 5.7 w^2 with w below 3 sigma, 3 sqrt 2 / 0.5 = 8.5 / s: 20.6, and
        // 1.3 of the slow one; vibration 1e-4 (2 pi 20)^2 = 1.6; 0.3. Together below 25, in three axes 44,
        // m/s^2. Over 0.1 ms: 4.4e-3 m/s; differences round to 1e-14 m / 2e-5 s.
        let mut largest: f64 = 0.0;
        for i in 0..20_000 {
            let t = f64::from(i) * 1e-4;
            largest = largest.max(velocity(t).distance(velocity(t + 1e-4)));
        }
        assert!(largest < 4.4e-3, "{largest}");
        // And the two sways are not the same one.
        let [Perturbation::Sway(a), Perturbation::Sway(b)] = &track.perturbations[..2] else {
            panic!("two sways first");
        };
        assert_ne!(a.at(0.0), b.at(0.0));
        assert!(Perturbation::sway(rms, 0.0, 7, 0).is_err());
    }
}
