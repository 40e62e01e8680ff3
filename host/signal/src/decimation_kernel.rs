//! Interpolation between the samples that a decimation retains, for signals within a band of less than half a cycle per retained sample.
//!
//! A decimation by `M` retains every `M`-th sample. The samples between are interpolated from `W` retained ones at the fractions `r / M`:
//!
//! ```text
//! s(r/M) = sum_i h_r[i] s(i - W/2 + 1),    i = 0 .. W-1,  r = 1 .. M-1
//! ```
//!
//! The taps minimise the squared error at frequencies of a band that are denser towards its edge, like Chebyshev nodes, which nearly minimises
//! the largest error. Taps at `1 - r/M` are those at `r/M` in reverse order. A tone at `x` cycles per retained sample is multiplied by
//! `H_r(x) = sum h_r[i] exp(j 2 pi x (i - W/2 + 1 - r/M))`. The error of an interpolation by `M` is [`DecimationKernel::error`], the root of
//! the mean of `|H_r(x) - 1|^2` over the band and all samples, retained ones included. It is about the same for `M` of 2 and 3, dB:
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

use num_complex::Complex64;

use crate::phase::phasor;

/// Supported numbers of taps, ascending.
pub const TAPS: [usize; 5] = [6, 8, 10, 12, 16];

/// Number of frequencies in the band for which a kernel is designed.
const PLACES: usize = 80;

/// Number of frequencies of a mean over the band: six for each period of the squared error of 16 taps.
const MEAN_PLACES: usize = 96;

/// Step of the search for the widest band, cycles per retained sample.
const BAND_STEP: f64 = 0.001;

/// Interpolation kernel of a decimation by two or three.
#[derive(Clone, Debug, PartialEq)]
pub struct DecimationKernel {
    factor: usize,
    /// Taps at the fraction `1 / factor`.
    taps: Vec<f64>,
    /// Band edge of the design, cycles per retained sample.
    band: f64,
}

impl DecimationKernel {
    /// Design a kernel with `count` taps, an even number, for decimation by `factor` and frequencies up to `band`, cycles per retained sample.
    ///
    /// # Panics
    /// If `factor` is neither 2 nor 3, `count` is odd or 0, or `band` is not between 0 and 0.5.
    pub fn new(factor: usize, count: usize, band: f64) -> Self {
        assert!(factor == 2 || factor == 3);
        assert!(count > 0 && count.is_multiple_of(2));
        assert!(band > 0.0 && band < 0.5);
        let places = (0..=PLACES).map(|i| band * libm::cos(0.5 * PI * i as f64 / PLACES as f64));
        let places: Vec<f64> = places.collect();
        let response = |i: usize| {
            let radians = move |x: &f64| TAU * x * distance(factor, count, i);
            let cosines = places.iter().map(move |x| libm::cos(radians(x)));
            cosines.chain(places.iter().map(move |x| libm::sin(radians(x))))
        };
        let wanted: Vec<f64> = (0..2 * places.len())
            .map(|i| if i < places.len() { 1.0 } else { 0.0 })
            .collect();
        let taps = match factor {
            // Taps at the midpoint are symmetric: imaginary parts cancel.
            2 => {
                let real = |i| response(i).take(places.len()).map(|cos| 2.0 * cos);
                let columns = (count / 2..count).map(|i| real(i).collect());
                let half = least_squares(columns.collect(), &wanted[..places.len()]);
                half.iter().rev().chain(&half).copied().collect()
            }
            _ => {
                let columns = (0..count).map(|i| response(i).collect());
                least_squares(columns.collect(), &wanted)
            }
        };
        Self { factor, taps, band }
    }

    /// Weights of the retained samples around the fraction `1 / factor`.
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// Relative error of an interpolated tone at `x` cycles per retained sample: the magnitude of its response minus 1.
    pub fn tone_error(&self, x: f64) -> f64 {
        self.error_power(x).sqrt()
    }

    fn error_power(&self, x: f64) -> f64 {
        let first = distance(self.factor, self.taps.len(), 0);
        let (mut phasor, step) = (phasor(x * first), phasor(x));
        let mut error = Complex64::new(-1.0, 0.0);
        for h in &self.taps {
            error += phasor * h;
            phasor *= step;
        }
        error.norm_sqr()
    }

    /// Part of the samples that are interpolated.
    pub fn interpolated(&self) -> f64 {
        (self.factor - 1) as f64 / self.factor as f64
    }

    /// Relative RMS error of interpolation over the band of the design and over all samples. The error of retained samples is zero.
    pub fn error(&self) -> f64 {
        self.error_within(self.band)
    }

    /// Relative RMS error of interpolation over tones up to `band` cycles per retained sample.
    pub fn error_within(&self, band: f64) -> f64 {
        let places = (0..MEAN_PLACES).map(|i| band * (i as f64 + 0.5) / MEAN_PLACES as f64);
        let squares: f64 = places.map(|x| self.error_power(x)).sum();
        (self.interpolated() * squares / MEAN_PLACES as f64).sqrt()
    }

    /// Widest band, at least that of the design, for which [`Self::error_within`] is at most `error`; cycles per retained sample. Zero if the
    /// error over the band of the design is larger.
    pub fn widest_band(&self, error: f64) -> f64 {
        let mut mean = self.error();
        if mean > error {
            return 0.0;
        }
        // Beyond the design band the error rises monotonically; at half a cycle it is near 1. Sums by the trapezoidal rule.
        let mut band = self.band;
        let mut power = self.error_power(band);
        let mut sum = mean * mean / self.interpolated() * band;
        while band + BAND_STEP < 0.5 {
            let next = self.error_power(band + BAND_STEP);
            sum += 0.5 * (power + next) * BAND_STEP;
            let wider = (self.interpolated() * sum / (band + BAND_STEP)).sqrt();
            if wider > error {
                return band + BAND_STEP * libm::log(error / mean) / libm::log(wider / mean);
            }
            (band, power, mean) = (band + BAND_STEP, next, wider);
        }
        band
    }
}

/// Distance of the retained sample of tap `i`, of `count`, from the fraction `1 / factor`, retained samples.
fn distance(factor: usize, count: usize, i: usize) -> f64 {
    i as f64 - (count / 2) as f64 + 1.0 - 1.0 / factor as f64
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

    #[test]
    fn interpolation_error_matches_documentation() {
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
            for factor in [2, 3] {
                let kernel = DecimationKernel::new(factor, taps, band);
                let error_db = 20.0 * kernel.error().log10();
                let allowed_db = if factor == 2 { 0.1 } else { 1.0 };
                assert!(
                    (error_db - stated_db).abs() < allowed_db,
                    "{factor} {taps} {band}: {error_db}"
                );
                // Tones interpolated at all fractions; retained samples have no error.
                let mut squares = 0.0;
                for i in 0..=500 {
                    let x = band * f64::from(i) / 500.0;
                    let at = |place: f64| Complex64::from_polar(1.0, TAU * x * (place + 3.7));
                    let first = 1.0 - taps as f64 / 2.0;
                    for r in 1..factor {
                        let mut taps = kernel.taps().to_vec();
                        if r == 2 {
                            taps.reverse();
                        }
                        let terms = taps.iter().enumerate();
                        let got: Complex64 = terms.map(|(i, h)| at(first + i as f64) * h).sum();
                        squares += (got - at(r as f64 / factor as f64)).norm_sqr();
                    }
                }
                let got_db = 10.0 * (squares / 501.0 / factor as f64).log10();
                assert!(
                    (got_db - error_db).abs() < 0.1,
                    "{factor} {taps} {band}: {got_db}"
                );
            }
        }
    }

    #[test]
    fn interpolation_error_grows_with_band() {
        for factor in [2, 3] {
            let kernel = DecimationKernel::new(factor, 8, 0.25);
            assert_eq!(kernel.widest_band(kernel.error()), 0.25);
            assert_eq!(kernel.widest_band(0.99 * kernel.error()), 0.0);
            let band = kernel.widest_band(2.0 * kernel.error());
            assert!(band > 0.26 && band < 0.3, "{band}");
            // The error grows by 12 dB in 0.02, an interval of the midpoint rule's by 1.5 dB: its last terms are 0.5 % small.
            assert!((kernel.error_within(band) / kernel.error() - 2.0).abs() < 0.02);
        }
    }
}
