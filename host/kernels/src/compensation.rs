//! Samples of a pulse referred to another path: each turned by a phase that grows evenly with frequency.
//!
//! ```text
//! out[k] = w[k] z[k] exp(+j 2 pi (a + b k)) s,    k = 0 .. K-1
//! ```
//!
//! The phase is a [`Ramp`]: a complex number in float64 that is multiplied on from sample to sample, or from some to the next, good to `K`
//! roundings of 2.5e-16. It is rounded to float32 where it meets a sample: 3e-7 of a sample in all.

use num_complex::{Complex32, Complex64};
use subaperture_signal::phase::{narrow, phasor};

/// `exp(j 2 pi (a + b k))`, times a factor, for `k` = 0, 1, ...
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    turn: Complex64,
    step: Complex64,
}

impl Ramp {
    /// From `start_turns` by `step_turns`, everything times `factor`.
    #[inline]
    pub fn new(start_turns: f64, step_turns: f64, factor: f64) -> Self {
        Self {
            turn: phasor(start_turns) * factor,
            step: phasor(step_turns),
        }
    }
}

impl Iterator for Ramp {
    type Item = Complex64;

    #[inline]
    fn next(&mut self) -> Option<Complex64> {
        let turn = self.turn;
        self.turn *= self.step;
        Some(turn)
    }
}

/// The samples in place, turned and weighted; the weights meet the phase in float64.
///
/// # Panics
/// If there are not as many weights as samples.
#[inline]
pub fn refer(samples: &mut [Complex32], weights: &[f64], ramp: Ramp) {
    assert_eq!(samples.len(), weights.len());
    for ((z, w), turn) in samples.iter_mut().zip(weights).zip(ramp) {
        *z *= narrow(turn * w);
    }
}

/// The samples, turned and weighted, into every `stride`-th element of `column`: a column of a matrix that is
/// stored frequency by frequency.
///
/// # Panics
/// If there are not as many weights as samples, or not as many elements.
#[inline]
pub fn refer_to_column(
    samples: &[Complex32],
    weights: &[f32],
    ramp: Ramp,
    column: &mut [Complex32],
    stride: usize,
) {
    assert_eq!(samples.len(), weights.len());
    assert!(samples.len() <= column.len().div_ceil(stride));
    // Some at a time, so that a phase need not wait for the one before.
    let Ramp { mut turn, step } = ramp;
    let [two, three] = [step * step, step * step * step];
    let steps = [Complex64::ONE, step, two, three];
    let rows = samples.chunks(steps.len()).zip(weights.chunks(steps.len()));
    for ((samples, weights), column) in rows.zip(column.chunks_mut(stride * steps.len())) {
        let column = column.iter_mut().step_by(stride);
        for (((out, z), w), step) in column.zip(samples).zip(weights).zip(steps) {
            *out = z * narrow(turn * step) * w;
        }
        turn *= two * two;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};

    #[test]
    fn a_ramp_keeps_its_phase() {
        let (start, step, count) = (-12_345.678, 0.0123, 100_000);
        let last = Ramp::new(start, step, 3.0).nth(count).unwrap();
        let expected = turned(start + step * count as f64) * 3.0;
        // Each product is rounded to 2.5e-16, the step's own phase and sine as well; start and last to 1e-12.
        let allowed = 3.0 * (count as f64 * 5e-16 + 1e-11);
        assert!((last - expected).norm() < allowed, "{last} {expected}");
    }

    /// Of a sample of magnitude 1: phasor rounded (4e-8 in each part), product (1.3e-7), weight (8e-8).
    #[test]
    fn samples_are_turned_and_weighted() {
        let mut numbers = Numbers::new(1);
        let samples = numbers.samples(301);
        let weights: Vec<f64> = (0..301).map(|_| numbers.unit()).collect();
        let narrow_weights: Vec<f32> = weights.iter().map(|&w| w as f32).collect();
        let (start, step, factor) = (831.25, -0.377, 0.75);
        let ramp = Ramp::new(start, step, factor);
        let plain = |k: usize| wide(samples[k]) * turned(start + step * k as f64) * factor;

        let mut in_place = samples.clone();
        refer(&mut in_place, &weights, ramp);
        let mut matrix = vec![Complex32::ZERO; 301 * 4];
        refer_to_column(&samples, &narrow_weights, ramp, &mut matrix[2..], 4);
        for k in 0..301 {
            let weighted = plain(k) * weights[k];
            for got in [in_place[k], matrix[4 * k + 2]] {
                let error = (wide(got) - weighted).norm();
                assert!(error < 3e-7, "{k}: {error}");
            }
            let others = [matrix[4 * k], matrix[4 * k + 1], matrix[4 * k + 3]];
            assert_eq!(others, [Complex32::ZERO; 3]);
        }
    }
}
