//! Keystone resampling: sinc interpolation of slow time, followed by a zero-padded Doppler FFT.
//!
//! **Equation** (Schone 2020, sections 3.1 and 5.1), with `a = f[k] / f_ref`:
//!
//! ```text
//! y[i] = sum_m sinc(t_i - m) z[m],   t_i = (i - M/2) / a + M/2,   sinc(x) = sin(pi x) / (pi x)
//! out[d] = sum_i y[i] exp(-j 2 pi (i - M/2)(d - D/2) / D)
//! ```
//!
//! **Neglected**: pulses before the first and after the last, which the sinc would need. If `a < 1` (`a > 1`) the
//! output pulses extend beyond (end before) the sub-CPI by up to `M/2 |1 - 1/a|` pulses. More pulses do not reduce
//! this error. Measured on four scatterers, 32 pulses, 200 MHz at 10 GHz: the map is -32.9 dB from the exact one
//! without a slow-time window and -43.9 dB with a Hamming window, which is applied before resampling
//! (`tests/stream/map.rs`). Use [`super::chirp_z`] where this matters.
//!
//! **Input**: `M` windowed samples of one frequency. **Output**: `D` Doppler bins spaced `1/D` cycles per pulse at
//! `f_ref`, zero Doppler at `D/2`, unscaled. **Cost**: a matrix of `M M` f32 per frequency, read once; `2 M M`
//! multiply-adds and one FFT of `D` points: 12 k instructions at `M = 32`, `D = 64` under QEMU's Cortex-M7.
//! **Accuracy** against its own definition in float64: -131 dB or better (`tests/stream/map.rs`).
//!
//! ```
//! use num_complex::Complex32;
//! use subaperture_core::keystone::sinc;
//! // At the reference frequency resampling is the identity. A constant is at zero Doppler, bin D/2.
//! let mut matrix = [0.0; 9];
//! sinc::fill_matrix(1.0, 3, &mut matrix);
//! let (mut scratch, mut out) = ([Complex32::ZERO; 4], [Complex32::ZERO; 4]);
//! sinc::transform(&matrix, &[Complex32::ONE; 3], &mut scratch, out.iter_mut());
//! assert_eq!(out[2], Complex32::new(3.0, 0.0));
//! ```

use core::f64::consts::PI;

use num_complex::Complex32;

use crate::fft;

/// Fill the matrix `[output pulse][input pulse]` of one frequency. `ratio` is `f[k] / f_ref`.
///
/// `matrix` must have `num_pulses * num_pulses` weights. Of another length, only whole rows are filled.
pub fn fill_matrix(ratio: f64, num_pulses: usize, matrix: &mut [f32]) {
    debug_assert_eq!(matrix.len(), num_pulses * num_pulses, "sinc matrix");
    let centre = (num_pulses / 2) as f64;
    for (i, row) in matrix.chunks_exact_mut(num_pulses.max(1)).enumerate() {
        let position = (i as f64 - centre) / ratio + centre;
        // sin(pi (position - m)) = (-1)^(nearest - m) sin(pi offset): one sine per row, and exact
        // where the position coincides with a pulse.
        let nearest = libm::round(position);
        let offset = position - nearest;
        let sine = libm::sin(PI * offset);
        for (m, weight) in row.iter_mut().enumerate() {
            let whole = nearest - m as f64;
            let sign = if whole % 2.0 == 0.0 { 1.0 } else { -1.0 };
            *weight = if offset == 0.0 {
                f32::from(u8::from(whole == 0.0))
            } else {
                (sign * sine / (PI * (offset + whole))) as f32
            };
        }
    }
}

/// Resample `pulses` by `matrix` and write the `D` Doppler bins to `column`.
///
/// `scratch` must have `D` samples, a length that [`fft::supports`] accepts and at least `M`, as
/// [`crate::Plan::new`] ensures. Otherwise nothing is written to `column`.
pub fn transform<'a>(
    matrix: &[f32],
    pulses: &[Complex32],
    scratch: &mut [Complex32],
    column: impl Iterator<Item = &'a mut Complex32>,
) {
    let (m, d) = (pulses.len(), scratch.len());
    if m > d || !fft::supports(d) {
        debug_assert!(
            false,
            "Doppler transform length: expected a power of two, at least M"
        );
        return;
    }
    scratch.fill(Complex32::ZERO);
    // Pulse i - M/2, modulo D: a circular shift instead of a phase ramp.
    let Some((late, early)) = scratch.split_at_mut_checked(d - m / 2) else {
        return;
    };
    let places = early.iter_mut().chain(late);
    for (place, weights) in places.zip(matrix.chunks_exact(m.max(1))) {
        let mut sum = Complex32::ZERO;
        for (weight, sample) in weights.iter().zip(pulses) {
            sum += *sample * *weight;
        }
        *place = sum;
    }
    fft::forward(scratch);
    let (positive, negative) = scratch.split_at(scratch.len() / 2);
    for (out, value) in column.zip(negative.iter().chain(positive)) {
        *out = *value;
    }
}
