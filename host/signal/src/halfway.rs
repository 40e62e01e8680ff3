//! Interpolation halfway between samples, for signals within a band of less than half a cycle per sample.
//!
//! ```text
//! s(1/2) = sum_i h[i] s(i - W/2 + 1),    i = 0 .. W-1
//! ```
//!
//! The symmetric taps minimise the squared error at frequencies of a band that are denser towards its edge, like
//! Chebyshev nodes, which nearly minimises the largest error. A tone at `x` is multiplied by `H(x) = 2 sum h[i] cos(2
//! pi x (i - W/2 + 1/2))`, summed over the upper half of the taps. The error of interpolation by two, which keeps the
//! even samples, is [`MidpointKernel::error`], the root of half the mean of `(H(x) - 1)^2` over the band, dB:
//!
//! | taps | band 0.2 | 0.25 | 0.3 |
//! |---|---|---|---|
//! | 6 | -68.9 | -56.3 | -45.6 |
//! | 8 | -89.5 | -72.8 | -58.5 |
//! | 10 | -110.0 | -89.0 | -71.1 |
//! | 12 | -130.3 | -105.1 | -83.6 |
//!
//! Float32 taps add 4e-8 (-148 dB).

use std::f64::consts::{PI, TAU};

/// Supported numbers of taps, ascending.
pub const TAPS: [usize; 5] = [6, 8, 10, 12, 16];

/// Number of frequencies in the band.
const PLACES: usize = 80;

/// Steps of the bisection of bands, of half of the remaining ones each.
const BISECTIONS: usize = 12;

/// Interpolation kernel for the midpoint between samples.
#[derive(Clone, Debug, PartialEq)]
pub struct MidpointKernel {
    taps: Vec<f64>,
    /// Band edge of the design, cycles per sample.
    band: f64,
}

impl MidpointKernel {
    /// Design a kernel with `count` taps, an even number, for frequencies up to `band`, cycles per sample.
    ///
    /// # Panics
    /// If `count` is odd or 0, or `band` is not between 0 and 0.5.
    pub fn new(count: usize, band: f64) -> Self {
        assert!(count > 0 && count.is_multiple_of(2));
        assert!(band > 0.0 && band < 0.5);
        let places = (0..=PLACES).map(|i| band * libm::cos(0.5 * PI * i as f64 / PLACES as f64));
        let places: Vec<f64> = places.collect();
        let columns = (0..count / 2).map(|i| {
            let terms = places.iter().map(|x| response(*x, i));
            terms.collect()
        });
        let half = least_squares(columns.collect(), &vec![1.0; places.len()]);
        let taps = half.iter().rev().chain(&half).copied().collect();
        Self { taps, band }
    }

    /// Weights of the samples around the midpoint.
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// Relative error of a tone at `x` cycles per sample: its response minus 1.
    pub fn tone_error(&self, x: f64) -> f64 {
        let half = self.taps.len() / 2;
        let terms = self.taps[half..].iter().enumerate();
        terms.map(|(i, h)| h * response(x, i)).sum::<f64>() - 1.0
    }

    /// Relative RMS error of interpolation by two, over the band of the design and over all output samples. The error of every second
    /// output sample is zero, since it is an input sample.
    pub fn error(&self) -> f64 {
        self.error_within(self.band)
    }

    /// Relative RMS error of interpolation by two, over tones up to `band` cycles per sample.
    pub fn error_within(&self, band: f64) -> f64 {
        let places = (0..PLACES).map(|i| band * (i as f64 + 0.5) / PLACES as f64);
        let squares: f64 = places.map(|x| self.tone_error(x).powi(2)).sum();
        (squares / PLACES as f64 / 2.0).sqrt()
    }

    /// Widest band, at least that of the design, for which [`Self::error_within`] is at most `error`; cycles per sample.
    pub fn widest_band(&self, error: f64) -> f64 {
        // Beyond the design band the error rises monotonically; the response at half a cycle is zero.
        let (mut low, mut high) = (self.band, 0.5);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            match self.error_within(middle) <= error {
                true => low = middle,
                false => high = middle,
            }
        }
        low
    }
}

/// Response of a tone to two taps of 1 at distances `i + 1/2` to either side.
fn response(x: f64, i: usize) -> f64 {
    2.0 * libm::cos(TAU * x * (i as f64 + 0.5))
}

/// Weights of the columns whose weighted sum is nearest to `wanted`, by orthogonalisation (Gram-Schmidt, applied
/// twice).
fn least_squares(mut columns: Vec<Vec<f64>>, wanted: &[f64]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // For each column, its projections onto the previous ones, and the norm of the remainder.
    let mut triangle: Vec<(Vec<f64>, f64)> = Vec::new();
    for j in 0..columns.len() {
        let (before, rest) = columns.split_at_mut(j);
        let column = &mut rest[0];
        let mut shares = vec![0.0; j];
        for _ in 0..2 {
            for (other, share) in before.iter().zip(&mut shares) {
                let more = dot(other, column);
                *share += more;
                column
                    .iter_mut()
                    .zip(other)
                    .for_each(|(a, b)| *a -= more * b);
            }
        }
        let norm = dot(column, column).sqrt();
        column.iter_mut().for_each(|a| *a /= norm);
        triangle.push((shares, norm));
    }
    let mut weights: Vec<f64> = columns.iter().map(|column| dot(column, wanted)).collect();
    // Back substitution from the last weight.
    for (j, (shares, norm)) in triangle.iter().enumerate().rev() {
        weights[j] /= norm;
        let weight = weights[j];
        for (other, share) in weights.iter_mut().zip(shares) {
            *other -= share * weight;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    #[test]
    fn halfway_interpolation_error_matches_documentation() {
        for (taps, band, stated_db) in [
            (6, 0.2, -68.9),
            (6, 0.3, -45.6),
            (8, 0.2, -89.5),
            (8, 0.25, -72.8),
            (10, 0.25, -89.0),
            (10, 0.3, -71.1),
            (12, 0.25, -105.1),
            (12, 0.3, -83.6),
        ] {
            let kernel = MidpointKernel::new(taps, band);
            assert!(
                (20.0 * kernel.error().log10() - stated_db).abs() < 0.1,
                "{taps}"
            );
            // Tones interpolated at half of the samples only, hence the factor of 2.
            let mut squares = 0.0;
            for i in 0..=500 {
                let x = band * f64::from(i) / 500.0;
                let at = |place: f64| Complex64::from_polar(1.0, TAU * x * (place + 3.7));
                let first = 1.0 - taps as f64 / 2.0;
                let terms = kernel.taps().iter().enumerate();
                let got: Complex64 = terms.map(|(i, h)| at(first + i as f64) * h).sum();
                squares += (got - at(0.5)).norm_sqr();
            }
            let got_db = 10.0 * (squares / 501.0 / 2.0).log10();
            assert!((got_db - stated_db).abs() < 0.1, "{taps} {band}: {got_db}");
        }
    }

    #[test]
    fn interpolation_error_grows_with_band() {
        let kernel = MidpointKernel::new(8, 0.25);
        assert_eq!(kernel.widest_band(kernel.error()), 0.25);
        let band = kernel.widest_band(2.0 * kernel.error());
        assert!(band > 0.26 && band < 0.3, "{band}");
        assert!((kernel.error_within(band) / kernel.error() - 2.0).abs() < 0.01);
    }
}
