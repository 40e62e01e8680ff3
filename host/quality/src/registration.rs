//! Registration: sub-pixel shift between two images.
//!
//! The cross-correlation of the mean-free magnitudes,
//!
//! ```text
//! C(s) = sum_p (|a(p + s)| - mean) (|b(p)| - mean)
//! ```
//!
//! peaks at the shift of `a` against `b`. The peak is found to a pixel by FFT of the whole images,
//! and to a fraction of a pixel by evaluating the Fourier sum of the correlation on successively finer steps
//! (Guizar-Sicairos et al. 2008). Magnitudes are used because the phases of two recordings may differ.
//!
//! The correlation is circular, so shifts
//! should be small against the image size. The magnitude has a wider band than the image; with pixels of half
//! the resolution, the error by aliasing is below a hundredth of a pixel
//! (`tests/images/quality.rs`). **Memory** 48 bytes per pixel. Non-finite pixels are replaced by the mean.

use num_complex::Complex64;
use subaperture_fft::FftDirection;

use super::transform::{signed, transform};
use super::{PairError, check_sizes};
use subaperture_model::image::{Image, power};

/// Finest search step, pixels.
const FINEST: f64 = 1.0 / 1024.0;

/// Shift between two images.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Offset {
    /// Row shift of `a` relative to `b`, pixels.
    pub rows: f64,
    /// Column shift of `a` relative to `b`, pixels.
    pub columns: f64,
    /// Correlation coefficient of the magnitudes at that shift, -1 to 1.
    pub correlation: f64,
}

/// Estimate the shift of `a` against `b`.
///
/// # Errors
/// [`PairError`] if the sizes differ or an image has no contrast.
pub fn offset(a: &Image, b: &Image) -> Result<Offset, PairError> {
    check_sizes(a, b)?;
    let (rows, columns) = (a.rows, a.columns);
    let (mut spectrum, a_power) = magnitudes(a)?;
    let (mut other, b_power) = magnitudes(b)?;
    transform(&mut spectrum, rows, columns, FftDirection::Forward);
    transform(&mut other, rows, columns, FftDirection::Forward);
    for (u, v) in spectrum.iter_mut().zip(&other) {
        *u *= v.conj();
    }
    let mut correlation = other;
    correlation.copy_from_slice(&spectrum);
    transform(&mut correlation, rows, columns, FftDirection::Inverse);
    let best = correlation
        .iter()
        .enumerate()
        .max_by(|x, y| x.1.re.total_cmp(&y.1.re))
        .map_or(0, |(i, _)| i);
    let (mut row, mut column) = (
        signed(best / columns, rows),
        signed(best % columns, columns),
    );
    let scale = 1.0 / ((rows * columns) as f64 * (a_power * b_power).sqrt());
    let mut step = 0.25;
    let mut top = correlation[best].re;
    while step >= FINEST {
        let offsets: Vec<f64> = (-4..=4).map(|i| f64::from(i) * step).collect();
        let values = around(&spectrum, (rows, columns), (row, column), &offsets);
        let (i, value) = values
            .iter()
            .enumerate()
            .max_by(|x, y| x.1.total_cmp(y.1))
            .expect("81 values");
        row += offsets[i / offsets.len()];
        column += offsets[i % offsets.len()];
        top = *value;
        step /= 4.0;
    }
    Ok(Offset {
        rows: row,
        columns: column,
        correlation: top * scale,
    })
}

/// Mean-free magnitudes, and the sum of their squares.
fn magnitudes(image: &Image) -> Result<(Vec<Complex64>, f64), PairError> {
    let values: Vec<f64> = image.pixels.iter().map(|&z| power(z).sqrt()).collect();
    let finite = || values.iter().filter(|v| v.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    let less: Vec<Complex64> = values
        .iter()
        .map(|v| if v.is_finite() { v - mean } else { 0.0 })
        .map(Complex64::from)
        .collect();
    let sum: f64 = less.iter().map(Complex64::norm_sqr).sum();
    match sum > 0.0 {
        true => Ok((less, sum)),
        false => Err(PairError::Unsuited(
            "registration needs contrast: all pixels of an image have the same magnitude"
                .to_owned(),
        )),
    }
}

/// Correlation at all pairs of `offsets` about `(row, column)`, row offsets outermost.
fn around(
    spectrum: &[Complex64],
    (rows, columns): (usize, usize),
    (row, column): (f64, f64),
    offsets: &[f64],
) -> Vec<f64> {
    let waves = |n: usize, at: f64| -> Vec<Complex64> {
        let turn = std::f64::consts::TAU * at / n as f64;
        (0..n)
            .map(|k| Complex64::cis(turn * signed(k, n)))
            .collect()
    };
    let across: Vec<_> = offsets.iter().map(|o| waves(columns, column + o)).collect();
    let down: Vec<_> = offsets.iter().map(|o| waves(rows, row + o)).collect();
    let mut out = vec![0.0; offsets.len() * offsets.len()];
    for (k, line) in spectrum.chunks_exact(columns).enumerate() {
        for (j, wave) in across.iter().enumerate() {
            let sum: Complex64 = line.iter().zip(wave).map(|(s, w)| s * w).sum();
            for (i, wave) in down.iter().enumerate() {
                out[i * offsets.len() + j] += (sum * wave[k]).re;
            }
        }
    }
    out
}
