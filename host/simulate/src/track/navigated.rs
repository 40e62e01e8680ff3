//! Measured track: the true track with the errors of satellite and inertial navigation.
//!
//! ```text
//! measured(t) = true(t) + bias + drift(t) + noise(t)
//! attitude(t) = true attitude(t) rotated by (bias + drift(t)) about the body's axes
//! ```
//!
//! Drift is a [`SmoothRandom`] process. Noise is drawn for each fix `n` at `t = n / rate`, independently, and
//! interpolated between fixes by `3 u^2 - 2 u^3`, so that the measured track and its velocity are continuous. The RMS
//! of the noise is the given one at the fixes, and 0.86 of it over all times (the mean of `(1 - s)^2 + s^2` over `u` is
//! 26 / 35). Errors of a navigation filter's model, loss of satellites, and timing errors are not modelled; a timing
//! error `dt` is a bias of `velocity dt`.
//!
//! The noise of any fix is computed without those before it: values do not depend on the order of evaluation. Cost: the
//! drifts' 96 cosines and two draws of three normals, some microseconds.

use std::sync::Arc;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{SmoothRandom, TrackError, turned};
use crate::random::{complex_normal, normal};
use subaperture_model::track::{Pose, Trajectory};

/// Random streams.
const DRIFT: u64 = u64::from_be_bytes(*b"navdrift");
const TURN: u64 = u64::from_be_bytes(*b"navturn\0");
const NOISE: u64 = u64::from_be_bytes(*b"navnoise");

/// Words of the noise's random stream per fix: one buffer of the generator, far more than three normals use.
const WORDS_A_FIX: u128 = 64;

/// Navigation errors of a measured track; all zero by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NavigationError {
    /// Constant position error, metres.
    pub bias_m: DVec3,
    /// RMS of the slow position drift per axis, metres.
    pub drift_rms_m: DVec3,
    /// RMS of the position noise of a fix per axis, metres.
    pub noise_rms_m: DVec3,
    /// Fixes per second; unused without noise.
    pub fix_rate_hz: f64,
    /// Constant errors of roll, pitch and yaw, radians.
    pub attitude_bias_rad: DVec3,
    /// RMS of the slow attitude drift, radians; small compared with 1.
    pub attitude_drift_rms_rad: DVec3,
    /// Correlation time of both drifts, seconds; unused without drift.
    pub drift_time_s: f64,
}

/// Measured track of a true track.
#[derive(Clone, Debug)]
pub struct Navigated {
    track: Arc<dyn Trajectory>,
    error: NavigationError,
    drift: Option<(SmoothRandom, SmoothRandom)>,
    seed: u64,
}

impl Navigated {
    /// Make the measured track of `track`; the same seed gives the same errors.
    ///
    /// # Errors
    /// [`TrackError`] for values that are not finite, noise without a fix rate, or drift without a correlation time.
    pub fn new(
        track: Arc<dyn Trajectory>,
        error: NavigationError,
        seed: u64,
    ) -> Result<Self, TrackError> {
        let vectors = [
            error.bias_m,
            error.drift_rms_m,
            error.noise_rms_m,
            error.attitude_bias_rad,
            error.attitude_drift_rms_rad,
        ];
        if !vectors.iter().all(|v| v.is_finite()) {
            return Err(TrackError(format!(
                "expected finite navigation errors: {error:?}"
            )));
        }
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if error.noise_rms_m != DVec3::ZERO && !positive(error.fix_rate_hz) {
            return Err(TrackError(format!(
                "navigation noise with {} fixes per second: expected a positive fix rate",
                error.fix_rate_hz
            )));
        }
        let drifts =
            error.drift_rms_m != DVec3::ZERO || error.attitude_drift_rms_rad != DVec3::ZERO;
        if drifts && !positive(error.drift_time_s) {
            return Err(TrackError(format!(
                "navigation drift with a correlation time of {} s: expected a positive time",
                error.drift_time_s
            )));
        }
        let process = |rms, kind| SmoothRandom::new(rms, error.drift_time_s, seed, kind);
        Ok(Self {
            track,
            error,
            drift: drifts.then(|| {
                (
                    process(error.drift_rms_m, DRIFT),
                    process(error.attitude_drift_rms_rad, TURN),
                )
            }),
            seed,
        })
    }

    fn noise_m(&self, time_s: f64) -> DVec3 {
        if self.error.noise_rms_m == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let fixes = time_s * self.error.fix_rate_hz;
        let (before, u) = (fixes.floor(), fixes - fixes.floor());
        let (from, to) = (self.fix(before), self.fix(before + 1.0));
        self.error.noise_rms_m * (from + (to - from) * (u * u * (3.0 - 2.0 * u)))
    }

    /// Three standard normal numbers of a fix, given its (whole) number.
    fn fix(&self, number: f64) -> DVec3 {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(NOISE);
        // The stream has 2^68 words, enough for 2^62 fixes; those before time 0 are at its end.
        let index = u128::from(number as i64 as u64 & (u64::MAX >> 2));
        random.set_word_pos(index * WORDS_A_FIX);
        let across = complex_normal(&mut random);
        DVec3::new(across.re, across.im, normal(&mut random))
    }
}

impl Trajectory for Navigated {
    fn pose(&self, time_s: f64) -> Pose {
        let pose = self.track.pose(time_s);
        let (drift_m, drift_rad) = match &self.drift {
            Some((offset, turn)) => (offset.at(time_s), turn.at(time_s)),
            None => (DVec3::ZERO, DVec3::ZERO),
        };
        let angles = self.error.attitude_bias_rad + drift_rad;
        Pose {
            position_m: pose.position_m + self.error.bias_m + drift_m + self.noise_m(time_s),
            attitude: pose.attitude * turned(angles.x, angles.y, angles.z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::track::Linear;

    fn truth() -> Arc<Linear> {
        Arc::new(Linear {
            position_m: DVec3::new(0.0, 0.0, 100.0),
            velocity_m_s: DVec3::new(30.0, 0.0, 0.0),
            at_s: 0.0,
        })
    }

    fn measured(error: NavigationError) -> Navigated {
        Navigated::new(truth(), error, 11).unwrap()
    }

    fn off(track: &Navigated, t: f64) -> DVec3 {
        track.pose(t).position_m - truth().pose(t).position_m
    }

    #[test]
    fn bias_is_constant_and_zero_errors_keep_true_track() {
        let track = measured(NavigationError {
            bias_m: DVec3::new(1.0, -2.0, 0.5),
            attitude_bias_rad: DVec3::new(0.0, 0.0, 0.01),
            ..NavigationError::default()
        });
        for t in [-5.0, 0.0, 77.7] {
            assert!(off(&track, t).distance(DVec3::new(1.0, -2.0, 0.5)) < 1e-12);
            let nose = track.pose(t).attitude * DVec3::X;
            assert!((nose.y - 0.01f64.sin()).abs() < 1e-15);
        }
        let perfect = measured(NavigationError::default());
        assert_eq!(perfect.pose(3.0), truth().pose(3.0));
    }

    #[test]
    fn noise_has_stated_rms_is_independent_and_smooth_between_fixes() {
        let track = measured(NavigationError {
            noise_rms_m: DVec3::new(0.02, 0.0, 0.05),
            fix_rate_hz: 20.0,
            ..NavigationError::default()
        });
        let (mut power, mut neighbours, mut between) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let count = 4000;
        for n in -count / 2..count / 2 {
            let t = f64::from(n) / 20.0;
            let now = off(&track, t);
            power += now * now;
            neighbours += now * off(&track, t + 0.05);
            let half = off(&track, t + 0.025);
            between += half * half;
            // Continuous velocity: flat at each fix. The second derivative of the interpolation is 6 * 400 / s^2 times
            // a difference of at most 10 RMS: over 1e-6 s, 1e-9 m.
            assert!(off(&track, t + 1e-6).distance(off(&track, t - 1e-6)) < 1e-9);
        }
        let n = f64::from(count);
        for (got, expected) in [(power.x / n, 4e-4), (power.z / n, 25e-4)] {
            // Standard error sqrt(2 / 4000) = 2.2 %; four times this is allowed.
            assert!((got / expected - 1.0).abs() < 0.09, "{got}");
        }
        assert_eq!(power.y, 0.0);
        // Standard error 1.6 %; four times this is allowed. Halfway between fixes, the mean of two values has half the
        // power.
        assert!((neighbours.z / power.z).abs() < 0.064);
        assert!((between.z / power.z - 0.5).abs() < 0.05);
    }

    #[test]
    fn errors_depend_on_seed_and_not_on_order_of_evaluation() {
        let error = NavigationError {
            drift_rms_m: DVec3::splat(0.1),
            noise_rms_m: DVec3::splat(0.02),
            fix_rate_hz: 10.0,
            drift_time_s: 30.0,
            attitude_drift_rms_rad: DVec3::splat(1e-3),
            ..NavigationError::default()
        };
        let track = measured(error);
        let times: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.37 - 3.0).collect();
        let forwards: Vec<Pose> = times.iter().map(|&t| track.pose(t)).collect();
        let backwards: Vec<Pose> = times
            .iter()
            .rev()
            .map(|&t| measured(error).pose(t))
            .collect();
        assert!(forwards.iter().eq(backwards.iter().rev()));
        let other = Navigated::new(truth(), error, 12).unwrap();
        assert!(off(&other, 1.0).distance(off(&track, 1.0)) > 1e-3);
    }

    #[test]
    fn noise_without_rate_and_drift_without_time_are_refused() {
        let refused = |error| Navigated::new(truth(), error, 0).unwrap_err().to_string();
        let none = NavigationError::default();
        let noise = NavigationError {
            noise_rms_m: DVec3::X,
            ..none
        };
        assert!(refused(noise).contains("0 fixes per second"));
        let drift = NavigationError {
            drift_rms_m: DVec3::X,
            ..none
        };
        assert!(refused(drift).contains("correlation time of 0 s"));
        let infinite = NavigationError {
            bias_m: DVec3::INFINITY,
            ..none
        };
        assert!(refused(infinite).contains("finite"));
    }
}
