//! Interpolation kernels without roll-off, for resampling before a product with another function.
//!
//! ```text
//! exp(j 2 pi x t) = sum_i h_i(t) exp(j 2 pi x (floor(t) - W/2 + 1 + i)),    |x| <= 1 / (2 s)
//! ```
//!
//! The weights of each fraction minimise the squared error over tones of the band of a signal oversampled by `s`. A Kaiser-Bessel kernel
//! ([`super::kaiser_bessel`]) needs half of the taps, but the spectrum must be divided by its roll-off at the sample's own
//! frequency, which is not known where frequencies of several samples were added.
//!
//! | taps | s = 1.4 | 1.6 | 1.8 | 2 |
//! |---|---|---|---|---|
//! | 8 | -45.9 dB | -56.9 | -66.2 | -74.3 |
//! | 10 | -54.9 | -68.7 | -80.4 | -90.5 |
//! | 12 | -63.7 | -80.3 | -94.4 | -106.4 |

use std::f64::consts::PI;

use super::dense::Factor;
use super::taps::{TERMS, even_and_odd};

/// Largest numbers of taps of a [`FlatKernel`].
pub const MAX_TAPS: usize = 16;
const MIN_TAPS: usize = 6;

/// Interpolation kernel without roll-off.
#[derive(Clone, Debug)]
pub struct FlatKernel {
    taps: usize,
    /// Weight and slope of every tap, for [`STEPS`] + 1 fractions from 0 to 1.
    table: Vec<[f32; 2]>,
    polynomials: Vec<[[f32; TERMS]; 2]>,
    error: f64,
}

/// Tabulated fractions per sample.
pub const STEPS: usize = 512;

impl FlatKernel {
    /// Design a kernel of `taps` taps, an even number, for signals oversampled by `oversampling`.
    ///
    /// # Panics
    /// If `taps` is odd, 0 or above [`MAX_TAPS`].
    pub fn new(taps: usize, oversampling: f64) -> Self {
        assert!(taps > 0 && taps.is_multiple_of(2) && taps <= MAX_TAPS);
        let solver = FlatDesign::new(taps, oversampling);
        let step = 1.0 / STEPS as f64;
        let fraction = |i: usize| (i as f64 - 1.0) * step;
        let weights: Vec<Vec<f64>> = (0..STEPS + 3)
            .map(|i| solver.weights(fraction(i)))
            .collect();
        let mut table = Vec::with_capacity((STEPS + 1) * taps);
        let mut squares = 0.0;
        for (i, own) in weights.windows(3).enumerate() {
            let [before, own, after] = [&own[0], &own[1], &own[2]];
            let slopes = before
                .iter()
                .zip(after)
                .map(|(a, b)| (b - a) / (2.0 * step));
            table.extend(own.iter().zip(slopes).map(|(&w, s)| [w as f32, s as f32]));
            squares += solver.square_error(fraction(i + 1), own);
        }
        Self {
            taps,
            table,
            polynomials: (0..taps / 2)
                .map(|tap| even_and_odd(|u| solver.weights(u + 0.5)[tap]))
                .collect(),
            error: (squares / (STEPS + 1) as f64).sqrt(),
        }
    }

    /// Error of a kernel ([`Self::error`]), from fewer fractions and without its table.
    pub fn error_of(taps: usize, oversampling: f64) -> f64 {
        const FRACTIONS: usize = 16;
        let design = FlatDesign::new(taps, oversampling);
        let fractions = (0..FRACTIONS).map(|i| (i as f64 + 0.5) / FRACTIONS as f64);
        let squares = fractions.map(|f| design.square_error(f, &design.weights(f)));
        (squares.sum::<f64>() / FRACTIONS as f64).sqrt()
    }

    /// Fewest taps with an error of at most `error`; `None` if [`MAX_TAPS`] have a larger one.
    pub fn taps_for(error: f64, oversampling: f64) -> Option<usize> {
        let counts = (MIN_TAPS..=MAX_TAPS).step_by(2);
        let mut good = counts.filter(|&taps| Self::error_of(taps, oversampling) <= error);
        (oversampling >= 1.0).then(|| good.next()).flatten()
    }

    /// Number of taps per interpolated value.
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// Polynomials of the weights, as of [`crate::kaiser_bessel::KaiserBessel::polynomials`].
    #[inline]
    pub fn polynomials(&self) -> &[[[f32; TERMS]; 2]] {
        &self.polynomials
    }

    /// Relative RMS error over all fractions and over tones of the band.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Weight and slope of each tap at the fraction `step` / [`STEPS`].
    #[inline(always)]
    pub fn row(&self, step: usize) -> &[[f32; 2]] {
        &self.table[step * self.taps..(step + 1) * self.taps]
    }
}

/// Normal equations of a [`FlatKernel`].
struct FlatDesign {
    taps: usize,
    band: f64,
    factor: Factor,
}

/// Regularisation, relative: rounding of the equations, -120 dB.
const REGULAR: f64 = 1e-12;

impl FlatDesign {
    fn new(taps: usize, oversampling: f64) -> Self {
        let band = 1.0 / oversampling;
        let place = |i: usize| ((i / taps) as f64, (i % taps) as f64);
        let equations = (0..taps * taps).map(place).map(|(i, j)| {
            let own = if i == j { REGULAR } else { 0.0 };
            correlation(band, i - j) + own
        });
        let factor = Factor::new(taps, &equations.collect::<Vec<f64>>(), 0.0);
        Self {
            taps,
            band,
            factor: factor.expect("the regularised equations are definite"),
        }
    }

    fn wanted(&self, fraction: f64) -> Vec<f64> {
        let first = 1.0 - self.taps as f64 / 2.0;
        (0..self.taps)
            .map(|i| correlation(self.band, fraction - first - i as f64))
            .collect()
    }

    fn weights(&self, fraction: f64) -> Vec<f64> {
        let mut weights = self.wanted(fraction);
        self.factor.solve(&mut weights);
        weights
    }

    /// Mean square error over the band of the interpolation at `fraction` with the weights that minimise it.
    fn square_error(&self, fraction: f64, weights: &[f64]) -> f64 {
        let wanted = self.wanted(fraction);
        let fitted = weights.iter().zip(&wanted).map(|(w, r)| w * r).sum::<f64>();
        (1.0 - fitted).max(REGULAR)
    }
}

/// Mean of `exp(j pi x t)` over `|x| <= band`.
fn correlation(band: f64, t: f64) -> f64 {
    let angle = PI * band * t;
    match angle == 0.0 {
        true => 1.0,
        false => libm::sin(angle) / angle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    /// Interpolation of tones by tabulated weights and by polynomials, against the tones.
    #[test]
    fn flat_kernel_has_its_stated_error() {
        for (taps, oversampling, db) in [(8, 1.6, -56.9), (10, 1.8, -80.4), (12, 1.6, -80.3)] {
            let kernel = FlatKernel::new(taps, oversampling);
            assert!((20.0 * kernel.error().log10() - db).abs() < 0.5);
            let (mut squares, mut count) = ([0.0; 2], 0);
            for step in (0..STEPS).step_by(5) {
                let fraction = step as f64 / STEPS as f64;
                let tabulated: Vec<f32> = kernel.row(step).iter().map(|row| row[0]).collect();
                let u = (fraction - 0.5) as f32;
                let mut evaluated = vec![0.0; taps];
                for (tap, parts) in kernel.polynomials().iter().enumerate() {
                    let [even, odd] =
                        parts.map(|c| c[0] + u * u * (c[1] + u * u * (c[2] + u * u * c[3])));
                    evaluated[tap] = even + u * odd;
                    evaluated[taps - 1 - tap] = even - u * odd;
                }
                for i in -100..=100 {
                    let tone = f64::from(i) / 201.0 / oversampling;
                    let first = 1.0 - taps as f64 / 2.0 - fraction;
                    for (square, weights) in squares.iter_mut().zip([&tabulated, &evaluated]) {
                        let terms = (0..).zip(weights.iter());
                        let sum: Complex64 = terms
                            .map(|(i, &w)| {
                                let turns = tone * (first + f64::from(i));
                                Complex64::from_polar(w.into(), 2.0 * PI * turns)
                            })
                            .sum();
                        *square += (sum - 1.0).norm_sqr();
                    }
                    count += 1;
                }
            }
            for square in squares {
                let rms = (square / f64::from(count)).sqrt();
                assert!((rms / kernel.error() - 1.0).abs() < 0.1, "{rms}");
            }
        }
    }
}
