//! Interpolation of data that cannot be prepared for its kernel: a sinc under a Kaiser window.
//!
//! A signal with spectrum inside `|x| <= band` cycles a sample is read between samples by
//!
//! ```text
//! s(t) = sum_i h(t - i) s(i),   h(t) = sinc(t) I0(beta sqrt(1 - (2 t / W)^2)) / I0(beta),  |t| < W / 2
//! ```
//!
//! Unlike [`super::kaiser_bessel`], nothing is divided out of the data first: maps that come from
//! elsewhere are taken as they are, for some more taps. `beta` is Kaiser's for a filter of `W` samples
//! whose transition runs from `band` to `1 - band` cycles a sample (J. F. Kaiser 1974; Oppenheim and
//! Schafer, section 7.5): `A = 8 + 2.285 * 2 pi (1 - 2 band) W` dB, `beta = 0.1102 (A - 8.7)`.
//!
//! **Error.** With `H` the transform of `h`, the sinc's rectangle smoothed by the window's transform,
//!
//! ```text
//! H(x) = integral from x - 1/2 to x + 1/2 of  W sinh(sqrt(beta^2 - (pi W y)^2)) /
//!                                             (I0(beta) sqrt(beta^2 - (pi W y)^2))  dy
//! ```
//!
//! a tone at `x` comes out `H(x)` high, with images `H(x + i)`; by Parseval over all places the mean
//! square error is `(H(x) - 1)^2 + sum over i != 0 of H(x + i)^2`. [`WindowedSinc::error`] averages that
//! over the band; the tests measure it. On data twice as fine as Nyquist's (`band` 1/4):
//!
//! | taps | 6 | 8 | 10 | 12 | 14 | 16 |
//! |---|---|---|---|---|---|---|
//! | error, dB | -53.7 | -67.0 | -80.3 | -94.2 | -108.6 | -122.9 |
//!
//! Weights come from a table of float32, linearly interpolated, good to 3e-6 of a weight (-110 dB), which
//! the figures above leave out.

use std::f64::consts::PI;

use super::taps::{KaiserWindow, WeightTable};

/// Numbers of taps that there are, fewest first.
pub const TAPS: [usize; 6] = [6, 8, 10, 12, 14, 16];

/// Widest band that a kernel is made for, cycles a sample: beyond it, `TAPS` do not suffice for
/// anything.
const WIDEST_BAND: f64 = 0.45;

/// A kernel of `taps` taps.
#[derive(Clone, Debug)]
pub struct WindowedSinc {
    taps: usize,
    window: KaiserWindow,
    table: WeightTable,
}

impl WindowedSinc {
    /// A kernel of `taps` taps, an even number, for signals within `band` cycles a sample.
    pub fn new(taps: usize, band: f64) -> Self {
        let transition = 1.0 - 2.0 * band.min(WIDEST_BAND);
        let attenuation_db = 8.0 + 2.285 * 2.0 * PI * transition * taps as f64;
        let beta = (0.1102 * (attenuation_db - 8.7)).max(0.0);
        let window = KaiserWindow::new(taps, beta);
        Self {
            taps,
            window,
            table: WeightTable::new(taps, |t| window.at(t) * sinc(t)),
        }
    }

    /// Number of taps.
    #[inline]
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// `h(t)`, `t` in samples.
    #[inline]
    pub fn at(&self, t: f64) -> f64 {
        self.window.at(t) * sinc(t)
    }

    /// The weights of `W` samples around a place: with `t = whole + fraction`, sample
    /// `whole - W/2 + 1 + i` has weight `i`.
    #[inline]
    pub fn weights<const W: usize>(&self, fraction: f32) -> [f32; W] {
        self.table.weights(fraction)
    }

    /// `H(x)`, by Simpson's rule on steps of a 16th of the window's side lobes.
    fn spectrum(&self, x: f64) -> f64 {
        let steps = 16 * self.taps;
        let step = 1.0 / steps as f64;
        let sum: f64 = (0..=steps)
            .map(|i| {
                let weight = match i {
                    0 => 1.0,
                    _ if i == steps => 1.0,
                    _ if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * self.window.spectrum(x - 0.5 + i as f64 * step)
            })
            .sum();
        sum * step / 3.0
    }

    /// Relative RMS error for a flat spectrum over `|x| <= band` cycles a sample.
    pub fn error(&self, band: f64) -> f64 {
        let points = 16;
        // H is even, so half of the band says all.
        let square: f64 = (0..points)
            .map(|i| {
                let x = band * (f64::from(i) + 0.5) / f64::from(points);
                let own = (self.spectrum(x) - 1.0).powi(2);
                let images: f64 = [-2.0, -1.0, 1.0, 2.0]
                    .iter()
                    .map(|image| self.spectrum(x + image).powi(2))
                    .sum();
                own + images
            })
            .sum();
        (square / f64::from(points)).sqrt()
    }
}

fn sinc(t: f64) -> f64 {
    if t == 0.0 {
        1.0
    } else {
        libm::sin(PI * t) / (PI * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    /// Interpolates tones all over the band by the defining sum in float64, and compares with the tones
    /// themselves.
    fn measured_error(kernel: &WindowedSinc, band: f64) -> f64 {
        let half = kernel.taps() as i32 / 2;
        let (mut error, mut count) = (0.0, 0.0);
        for i in 0..100 {
            let x = band * ((f64::from(i) + 0.5) / 100.0 * 2.0 - 1.0);
            for j in 0..50 {
                let t = f64::from(j) / 50.0;
                let got: Complex64 = (1 - half..=half)
                    .map(|i| {
                        Complex64::cis(2.0 * PI * x * f64::from(i)) * kernel.at(t - f64::from(i))
                    })
                    .sum();
                error += (got - Complex64::cis(2.0 * PI * x * t)).norm_sqr();
                count += 1.0;
            }
        }
        f64::sqrt(error / count)
    }

    #[test]
    fn error_is_as_predicted_and_documented() {
        let db = |x: f64| 20.0 * x.log10();
        let documented_db = [-53.7, -67.0, -80.3, -94.2, -108.6, -122.9];
        for (taps, documented_db) in TAPS.into_iter().zip(documented_db) {
            let kernel = WindowedSinc::new(taps, 0.25);
            let (measured, predicted) = (measured_error(&kernel, 0.25), kernel.error(0.25));
            println!(
                "{taps} taps: {:.1} dB, predicted {:.1} dB",
                db(measured),
                db(predicted)
            );
            // Sixteen points stand for the band, two images on either side for all.
            assert!((db(measured) - db(predicted)).abs() < 0.5, "{taps}");
            assert!((db(predicted) - documented_db).abs() < 0.5, "{taps}");
        }
        for band in [0.1, 0.2, 0.35] {
            let kernel = WindowedSinc::new(10, band);
            let (measured, predicted) = (measured_error(&kernel, band), kernel.error(band));
            println!(
                "band {band}: {:.1} dB, predicted {:.1} dB",
                db(measured),
                db(predicted)
            );
            assert!((db(measured) - db(predicted)).abs() < 0.5, "{band}");
        }
    }

    #[test]
    fn table_is_the_kernel() {
        let kernel = WindowedSinc::new(8, 0.25);
        for i in 0..=100 {
            let fraction = f64::from(i) / 100.0;
            for (j, w) in (0..8).zip(kernel.weights::<8>(fraction as f32)) {
                // h'' is at most pi^2 / 3 and the window's share: a table step of 1/512 leaves 2e-6.
                let error = f64::from(w) - kernel.at(fraction + 3.0 - f64::from(j));
                assert!(error.abs() < 3e-6, "{fraction} {j} {error}");
            }
        }
    }
}
