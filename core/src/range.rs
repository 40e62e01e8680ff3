//! Range compression: inverse DFT from frequency to range, in place on one Doppler row of the map.
//!
//! **Equation** (Schone 2020, chapter 2): `out[r] = sum_k g[k] exp(+j 2 pi (k - F/2)(r - R/2) / R)`.
//! It is evaluated as a *forward* FFT of the row in which frequency `k` is stored at column
//! `-(k - F/2) mod R` ([`column()`]): reversing the index reverses the sign of the exponent, and no scale factor
//! arises. The shift by `R/2` is the factor `(-1)^(k - F/2)`, [`sign`], which a plan folds into the fast-time weights.
//!
//! **Neglected**: nothing. **Input**: `R` samples, the frequencies at their columns times their signs; the values
//! of the other columns are ignored. **Output**: `R` range bins spaced `c / (R step_hz)` of two-way path, path 0 at
//! `R/2`. **Cost**: one FFT of `R` points, no memory. **Accuracy**: that of [`crate::fft`]
//! (`tests/stream/stages.rs`).
//!
//! ```
//! use num_complex::Complex32;
//! use subaperture_core::range::{column, compress, sign};
//! // Three frequencies of a scatterer at path 0: a peak of 3 at bin R/2 = 2.
//! let mut row = [Complex32::ZERO; 4];
//! for k in 0..3 {
//!     row[column(k, 3, 4)] = Complex32::ONE * sign(k, 3);
//! }
//! compress(&mut row, 3);
//! assert_eq!(row[2], Complex32::new(3.0, 0.0));
//! ```

use num_complex::Complex32;

use crate::fft;

/// Column of frequency `k` in a row of `num_range_bins` samples, which must be a power of two.
pub const fn column(k: usize, num_frequencies: usize, num_range_bins: usize) -> usize {
    (num_frequencies / 2).wrapping_sub(k) & num_range_bins.wrapping_sub(1)
}

/// `(-1)^(k - F/2)`: factor of frequency `k` that centres path 0 on bin `R/2`.
pub const fn sign(k: usize, num_frequencies: usize) -> f32 {
    if k.wrapping_add(num_frequencies / 2).is_multiple_of(2) {
        1.0
    } else {
        -1.0
    }
}

/// Range-compress one row in place. Columns without a frequency are zeroed first.
///
/// The row length must satisfy [`fft::supports`] and be at least `num_frequencies`, as [`crate::Plan::new`]
/// ensures. A row of another length is not transformed.
pub fn compress(row: &mut [Complex32], num_frequencies: usize) {
    // Frequencies fill columns 0 to F/2 and the last F - 1 - F/2. The padding in between may be empty.
    let above = num_frequencies.saturating_sub(1) / 2;
    let padding = num_frequencies / 2 + 1..row.len().saturating_sub(above);
    if let Some(padding) = row.get_mut(padding) {
        padding.fill(Complex32::ZERO);
    }
    fft::forward(row);
}
