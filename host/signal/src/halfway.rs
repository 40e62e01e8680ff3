//! Interpolation halfway between samples, of signals no faster than a quarter cycle a sample.
//!
//! ```text
//! s(1/2) = sum_i h[i] s(i - W/2 + 1),    i = 0 .. W-1
//! ```
//!
//! with the symmetric taps that are best by least squares at places of the band that lie closer towards its edge, as
//! Chebyshev's do: nearly those of least largest error. A tone at `x` comes out `H(x) = 2 sum h[i] cos(2 pi x (i - W/2 + 1/2))` over the
//! upper half of the taps; the error of a halving, whose even places stay as they are, is [`Halfway::error`], the root of half the mean
//! of `(H(x) - 1)^2` over the band:
//!
//! | taps | 8 | 10 | 12 | 16 |
//! |---|---|---|---|---|
//! | error, dB | -72.8 | -89.0 | -105.1 | -136.9 |
//!
//! Float32 taps leave 4e-8 (-148 dB) besides.

use std::f64::consts::{PI, TAU};

/// Numbers of taps that there are, fewest first.
pub const TAPS: [usize; 4] = [8, 10, 12, 16];

/// Widest band, cycles a sample.
pub const BAND: f64 = 0.25;

/// Places of the band.
const PLACES: usize = 400;

/// The taps of a kernel, and what they leave.
#[derive(Clone, Debug, PartialEq)]
pub struct Halfway {
    taps: Vec<f64>,
}

impl Halfway {
    /// Of `count` taps, an even number.
    ///
    /// # Panics
    /// If it is odd or 0.
    pub fn new(count: usize) -> Self {
        assert!(count > 0 && count.is_multiple_of(2));
        let places = (0..=PLACES).map(|i| BAND * libm::cos(0.5 * PI * i as f64 / PLACES as f64));
        let places: Vec<f64> = places.collect();
        let columns = (0..count / 2).map(|i| {
            let terms = places.iter().map(|x| response(*x, i));
            terms.collect()
        });
        let half = least_squares(columns.collect(), &vec![1.0; places.len()]);
        let taps = half.iter().rev().chain(&half).copied().collect();
        Self { taps }
    }

    /// The weights of the samples about a place.
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// What a tone at `x` cycles a sample comes out as, less 1.
    pub fn tone_error(&self, x: f64) -> f64 {
        let half = self.taps.len() / 2;
        let terms = self.taps[half..].iter().enumerate();
        terms.map(|(i, h)| h * response(x, i)).sum::<f64>() - 1.0
    }

    /// Relative RMS error of a halving: over the band, and over places of which every other stays as it is.
    pub fn error(&self) -> f64 {
        self.error_within(BAND)
    }

    /// The same over tones up to `band`.
    pub fn error_within(&self, band: f64) -> f64 {
        let places = (0..=PLACES).map(|i| band * i as f64 / PLACES as f64);
        let squares: f64 = places.map(|x| self.tone_error(x).powi(2)).sum();
        (squares / (PLACES + 1) as f64 / 2.0).sqrt()
    }

    /// The widest band, of at least [`BAND`], within which that is `error` at most.
    pub fn widest_band(&self, error: f64) -> f64 {
        // From there on the error rises steadily; half a cycle is read as nothing.
        let (mut low, mut high) = (BAND, 0.5);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            match self.error_within(middle) <= error {
                true => low = middle,
                false => high = middle,
            }
        }
        low
    }
}

/// Of a tone and two taps of 1, `i + 1/2` to either side.
fn response(x: f64, i: usize) -> f64 {
    2.0 * libm::cos(TAU * x * (i as f64 + 0.5))
}

/// The weights of columns whose sum is nearest to `wanted`: by orthogonal columns (Gram and Schmidt, twice).
fn least_squares(mut columns: Vec<Vec<f64>>, wanted: &[f64]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Of each column, its shares of those before and what is left of it.
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
    // The last one is known; it takes its shares from those before.
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
    fn errors_are_the_stated_ones() {
        for (taps, stated_db) in TAPS.into_iter().zip([-72.8, -89.0, -105.1, -136.9]) {
            let kernel = Halfway::new(taps);
            assert!(
                (20.0 * kernel.error().log10() - stated_db).abs() < 0.06,
                "{taps}"
            );
            // Tones interpolated: of half of the places, so 3 dB more.
            let mut squares = 0.0;
            for i in 0..=500 {
                let x = BAND * f64::from(i) / 500.0;
                let at = |place: f64| Complex64::from_polar(1.0, TAU * x * (place + 3.7));
                let first = 1.0 - taps as f64 / 2.0;
                let terms = kernel.taps().iter().enumerate();
                let got: Complex64 = terms.map(|(i, h)| at(first + i as f64) * h).sum();
                squares += (got - at(0.5)).norm_sqr();
            }
            let got_db = 10.0 * (squares / 501.0 / 2.0).log10();
            assert!((got_db - stated_db).abs() < 0.06, "{taps}: {got_db}");
        }
    }

    #[test]
    fn wider_bands_err_more() {
        let kernel = Halfway::new(8);
        assert_eq!(kernel.widest_band(kernel.error()), BAND);
        let band = kernel.widest_band(2.0 * kernel.error());
        assert!(band > 0.26 && band < 0.3, "{band}");
        assert!((kernel.error_within(band) / kernel.error() - 2.0).abs() < 1e-3);
    }
}
