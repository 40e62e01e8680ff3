//! Smooth random motion: a sum of sinusoids of random frequency and phase.
//!
//! ```text
//! x(t) = rms sqrt(2 / M) sum_i cos(w_i t + phi_i),   w_i ~ N(0, 2 / T^2),   phi_i ~ U(0, 2 pi)
//! E x(t) x(t + tau) = rms^2 exp(-(tau / T)^2)
//! ```
//!
//! Over all seeds it has zero mean, this RMS, and this correlation, which falls to `1 / e` at the correlation time `T`.
//! Its velocity has an RMS of `sqrt 2 rms / T`. All derivatives exist, and the largest value is `sqrt(2 M)` times the
//! RMS, 5.7 times. (A Gauss-Markov process has a correlation of `exp(-tau / T)`, and no velocity.)
//!
//! Neglected: with `M = 16` sinusoids the distribution is Gaussian up to a kurtosis of `3 - 1.5 / M`, and after
//! hundreds of `T` the process nearly repeats. A segment shorter than `T` is mostly a constant and a slope. Cost: 16
//! cosines per axis.

use std::f64::consts::{SQRT_2, TAU};

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::random::{normal, unit};

/// Number of sinusoids per axis.
const HARMONICS: usize = 16;

/// Smooth random vector as a function of time.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothRandom {
    rms: DVec3,
    /// Angular frequency and phase, by harmonic and axis.
    harmonics: Vec<[(f64, f64); 3]>,
}

impl SmoothRandom {
    /// Make a process with a given RMS per axis and a positive correlation time, seconds. Processes with one seed and
    /// different `kind` are independent.
    pub fn new(rms: DVec3, correlation_s: f64, seed: u64, kind: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(kind);
        let mut harmonic = || {
            let frequency = normal(&mut random);
            (frequency * SQRT_2 / correlation_s, unit(&mut random) * TAU)
        };
        let harmonics = (0..HARMONICS)
            .map(|_| std::array::from_fn(|_| harmonic()))
            .collect();
        Self { rms, harmonics }
    }

    /// Value at a time in seconds.
    pub fn at(&self, time_s: f64) -> DVec3 {
        let mut sum = [0.0; 3];
        for axes in &self.harmonics {
            for (sum, (frequency, phase)) in sum.iter_mut().zip(axes) {
                *sum += libm::cos(frequency * time_s + phase);
            }
        }
        self.rms * DVec3::from_array(sum) * (2.0 / HARMONICS as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_and_correlation_over_seeds_match_parameters() {
        let rms = DVec3::new(0.3, 0.0, 2.0);
        let seeds = 4000;
        let (mut power, mut product, mut speed) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for seed in 0..seeds {
            let process = SmoothRandom::new(rms, 5.0, seed, 1);
            let now = process.at(1000.0);
            power += now * now;
            product += now * process.at(1005.0);
            // Over 1 ms the difference has a relative error of (0.28 / s 1e-3 s)^2 / 6.
            let velocity = (process.at(1000.001) - now) / 1e-3;
            speed += velocity * velocity;
        }
        let n = seeds as f64;
        // Means over 4000 have a relative standard error of sqrt(2 / 4000), 2.2 %; four times this is 9 %.
        for (got, expected) in [(power.x, 0.09), (power.z, 4.0)] {
            assert!((got / n / expected - 1.0).abs() < 0.09, "{got}");
        }
        let correlation = product.z / power.z;
        assert!((correlation - (-1f64).exp()).abs() < 0.07, "{correlation}");
        // The velocity has a power of 2 rms^2 / T^2; the kurtosis of the frequencies adds 3 / 16 / 4000, which is
        // negligible.
        assert!((speed.z / n / (2.0 * 4.0 / 25.0) - 1.0).abs() < 0.1);
        assert_eq!(power.y, 0.0);
    }

    #[test]
    fn processes_differ_by_seed_kind_and_axis() {
        let at = |seed, kind| SmoothRandom::new(DVec3::ONE, 1.0, seed, kind).at(0.4);
        assert_eq!(at(1, 1), at(1, 1));
        assert!(at(1, 1).distance(at(2, 1)) > 1e-3);
        assert!(at(1, 1).distance(at(1, 2)) > 1e-3);
        assert!((at(1, 1).x - at(1, 1).y).abs() > 1e-3);
    }
}
