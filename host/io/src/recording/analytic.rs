//! Dechirped sweeps recorded as real numbers, by radars with one mixer and one converter.
//!
//! A real beat is the sum of a complex one and its conjugate, each with half of its amplitude: `a cos(w t) = (a / 2) exp(j w t) + (a / 2)
//! exp(-j w t)`. Delays are positive, so the sign of the beat is fixed: negative for a rising sweep, in the convention of
//! [`crate::receive`]. The other half of the spectrum is removed. The result is the complex beat with half of the amplitude, for delays up
//! to `sample_rate / (2 slope)`. Zero and half the sampling rate belong to both halves and are halved.
//!
//! A beat below a few bins (near targets, transmitter leakage) overlaps its conjugate and is removed in part. Cost: two
//! float64 transforms per sweep.

use num_complex::{Complex32, Complex64};
use subaperture_fft::Transforms;

/// Convert rows of `width` real samples to complex beats of rising or falling sweeps.
pub(super) fn beats(rows: &mut [Complex32], width: usize, rising: bool) {
    let forward = Transforms::Portable.forward::<f64>(width);
    let inverse = Transforms::Portable.inverse::<f64>(width);
    let mut spectrum = vec![Complex64::ZERO; width];
    let scale = 1.0 / width as f64;
    for row in rows.chunks_exact_mut(width) {
        for (bin, sample) in spectrum.iter_mut().zip(&*row) {
            *bin = Complex64::new(f64::from(sample.re), 0.0);
        }
        forward.process(&mut spectrum);
        for (k, bin) in spectrum.iter_mut().enumerate() {
            let (twice, both) = (2 * k, k == 0 || 2 * k == width);
            *bin *= match (both, (twice > width) == rising) {
                (true, _) => 0.5 * scale,
                (false, true) => scale,
                (false, false) => 0.0,
            };
        }
        inverse.process(&mut spectrum);
        for (sample, value) in row.iter_mut().zip(&spectrum) {
            *sample = Complex32::new(value.re as f32, value.im as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn real_beats_become_complex_ones_of_half_the_amplitude() {
        for width in [64usize, 63] {
            for (rising, sign) in [(true, -1.0), (false, 1.0)] {
                // Whole cycles in a sweep: exact except for float32.
                let turn = |k: usize| TAU * 7.0 * k as f64 / width as f64 + 0.3;
                let mut row: Vec<Complex32> = (0..width)
                    .map(|k| Complex32::new((3.0 * turn(k).cos()) as f32, 0.0))
                    .collect();
                beats(&mut row, width, rising);
                for (k, found) in row.iter().enumerate() {
                    let (sin, cos) = (sign * turn(k)).sin_cos();
                    let expected = Complex32::new((1.5 * cos) as f32, (1.5 * sin) as f32);
                    assert!(
                        (found - expected).norm() < 1e-6,
                        "{width} {k}: {found} {expected}"
                    );
                }
            }
        }
    }
}
