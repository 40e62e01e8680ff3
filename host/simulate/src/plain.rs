//! Simulated phase history of point scatterers on a given track, exact in the frequency domain, with thermal noise.
//!
//! Sample `k` of pulse `n` is the plain sum of Schone 2020 (2.11) over scatterers,
//!
//! ```text
//! z[n][k] = sum_s a_s exp(-j 2 pi f_k (path_n(p_s) - reference_path_n) / c) + noise
//! ```
//!
//! in float64, rounded once to float32. The platform stands still during a pulse (stop-and-go approximation) unless the
//! collection's pulses have intra-pulse motion ([`subaperture_model::phase_history::Sweep`]). Amplitudes do not depend
//! on range or frequency.
//!
//! Cost: 8 operations per scatterer, pulse and frequency; the phasor recurrence over frequency has an error below
//! 1e-13. With intra-pulse motion, one phasor each. Pulses are computed when read; only the geometry is held in memory.
//! Noise depends only on the seed and the pulse index, so that files are bit-identical with any number of threads.

use std::ops::Range;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

use crate::random::complex_normal;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, PhaseHistory, ReadError};
use subaperture_model::units::power_of_db;
use subaperture_signal::phase::{narrow, phasor};

/// Isotropic point scatterer with a frequency-independent amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatterer {
    /// Position in the scene frame, metres.
    pub position_m: DVec3,
    /// Complex amplitude; an amplitude of 1 gives a pixel of 1 in a focused image.
    pub amplitude: Complex64,
}

/// Thermal noise: complex Gaussian, independent between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Noise power of a sample relative to a unit scatterer, dB.
    pub power_db: f64,
    /// Seed; the same seed gives the same noise.
    pub seed: u64,
}

/// Collection of point scatterers whose samples are computed when read.
#[derive(Clone, Debug)]
pub struct PointTargetHistory {
    collection: Collection,
    scatterers: Vec<Scatterer>,
    noise: Option<Noise>,
}

impl PointTargetHistory {
    /// Make the phase history of `collection` over `scatterers`.
    pub fn new(collection: Collection, scatterers: Vec<Scatterer>, noise: Option<Noise>) -> Self {
        Self {
            collection,
            scatterers,
            noise,
        }
    }

    /// Scatterers of the scene.
    pub fn scatterers(&self) -> &[Scatterer] {
        &self.scatterers
    }

    fn pulse(&self, n: usize, row: &mut [Complex32], sum: &mut Vec<Complex64>) {
        let pulse = &self.collection.pulses[n];
        sum.clear();
        sum.resize(row.len(), Complex64::ZERO);
        let moves = !pulse.sweep.is_at_once();
        for s in &self.scatterers {
            if moves {
                for (k, z) in sum.iter_mut().enumerate() {
                    let after = k as f64 - (row.len() / 2) as f64;
                    let path_m = pulse.relative_path_after_m(s.position_m, after);
                    let turns = pulse.frequency_hz(k) * (path_m / SPEED_OF_LIGHT_M_S);
                    *z += s.amplitude * phasor(-turns);
                }
                continue;
            }
            let delay_s = pulse.relative_path_m(s.position_m) / SPEED_OF_LIGHT_M_S;
            let mut value = s.amplitude * phasor(-pulse.start_hz * delay_s);
            let step = phasor(-pulse.step_hz * delay_s);
            for z in sum.iter_mut() {
                *z += value;
                value *= step;
            }
        }
        if let Some(noise) = self.noise {
            // One random stream per pulse: independent of the order of reading.
            let mut random = ChaCha8Rng::seed_from_u64(noise.seed);
            random.set_stream(n as u64);
            let sigma = (power_of_db(noise.power_db) / 2.0).sqrt();
            for z in sum.iter_mut() {
                *z += complex_normal(&mut random) * sigma;
            }
        }
        for (out, z) in row.iter_mut().zip(sum.iter()) {
            *out = narrow(*z);
        }
    }
}

impl PhaseHistory for PointTargetHistory {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.collection.num_samples;
        assert_eq!(
            samples.len(),
            pulses.len() * width,
            "samples must hold {pulses:?} whole"
        );
        samples
            .par_chunks_exact_mut(width)
            .zip(pulses)
            .for_each_init(Vec::new, |sum, (row, n)| self.pulse(n, row, sum));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Preset, Variation};

    #[test]
    fn single_scatterer_has_defined_phase() {
        let simulated = Preset::Table41.simulate(&Variation::default());
        let lone = PointTargetHistory::new(
            simulated.collection().clone(),
            vec![Scatterer {
                position_m: DVec3::new(3.0, -7.0, 0.0),
                amplitude: Complex64::ONE,
            }],
            None,
        );
        let width = lone.collection().num_samples;
        let mut samples = vec![Complex32::ZERO; 2 * width];
        lone.read(100..102, &mut samples).unwrap();
        let pulse = lone.collection().pulses[101];
        // Along-track position of pulse 101: (101 - 519.5) * 0.125 m; range by Pythagoras.
        let across = 3.0 - (101.0 - 519.5) * 0.125;
        let range_m = f64::hypot(4993.0, across);
        for k in [0, 77, width - 1] {
            let turns = -pulse.frequency_hz(k) * 2.0 * (range_m - 5000.0) / SPEED_OF_LIGHT_M_S;
            let phase = std::f64::consts::TAU * turns.rem_euclid(1.0);
            let expected = Complex64::new(phase.cos(), phase.sin());
            let got = samples[width + k];
            // float32 rounding: half an ulp of 1 in each part.
            assert!((f64::from(got.re) - expected.re).abs() < 1e-7);
            assert!((f64::from(got.im) - expected.im).abs() < 1e-7);
        }
    }

    #[test]
    fn noise_has_stated_power_and_is_independent_of_read_order() {
        let variation = Variation {
            noise: Some(Noise {
                power_db: -20.0,
                seed: 5,
            }),
            ..Variation::default()
        };
        let scene = Preset::Table41.simulate(&variation);
        let quiet = PointTargetHistory::new(scene.collection().clone(), vec![], scene.noise);
        let width = quiet.collection().num_samples;
        let mut all = vec![Complex32::ZERO; 64 * width];
        quiet.read(0..64, &mut all).unwrap();
        let mut one = vec![Complex32::ZERO; width];
        quiet.read(40..41, &mut one).unwrap();
        assert_eq!(one, all[40 * width..41 * width]);
        let power = all.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / all.len() as f64;
        // 16384 samples of an exponential variable: standard error 0.8 %; allow five of them.
        assert!((power / 0.01 - 1.0).abs() < 0.04, "{power}");
    }
}
