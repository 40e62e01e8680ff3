//! Interpolation without prefiltering of the data: sinc with a Kaiser window.
//!
//! A signal with a spectrum inside `|x| <= band` cycles per sample is interpolated by
//!
//! ```text
//! s(t) = sum_i h(t - i) s(i),   h(t) = sinc(t) I0(beta sqrt(1 - (2 t / W)^2)) / I0(beta),  |t| < W / 2
//! ```
//!
//! Unlike [`super::kaiser_bessel`], this needs no deapodisation: maps from other sources are used unchanged, at the
//! cost of some more taps. `beta` is Kaiser's for a filter of `W` samples with a transition from `band` to `1 - band`
//! cycles per sample (J. F. Kaiser 1974; Oppenheim and Schafer, section 7.5): `A = 8 + 2.285 * 2 pi (1 - 2 band) W` dB,
//! `beta = 0.1102 (A - 8.7)`.
//!
//! **Error.** Let `H` be the spectrum of `h`, the rectangle of the sinc convolved with the window's spectrum,
//!
//! ```text
//! H(x) = integral from x - 1/2 to x + 1/2 of  W sinh(sqrt(beta^2 - (pi W y)^2)) /
//!                                             (I0(beta) sqrt(beta^2 - (pi W y)^2))  dy
//! ```
//!
//! The response of a tone at `x` is `H(x)`, with images `H(x + i)`. By Parseval's theorem over all positions, the mean
//! square error is `(H(x) - 1)^2 + sum over i != 0 of H(x + i)^2`. [`WindowedSinc::error`] averages it over the band;
//! the tests measure it. For data oversampled by two (`band` 1/4):
//!
//! | taps | 6 | 8 | 10 | 12 | 14 | 16 |
//! |---|---|---|---|---|---|---|
//! | error, dB | -53.7 | -67.0 | -80.3 | -94.2 | -108.6 | -122.9 |
//!
//! Weights come from a linearly interpolated float32 table, accurate to 3e-6 of a weight (-110 dB); the figures above
//! exclude this error.

use std::f64::consts::PI;

use super::taps::{KaiserWindow, WeightTable};

/// Supported numbers of taps, ascending.
pub const TAPS: [usize; 6] = [6, 8, 10, 12, 14, 16];

/// Widest band of a kernel, cycles per sample; beyond it, the supported numbers of taps do not suffice.
const WIDEST_BAND: f64 = 0.45;

/// Kaiser-windowed sinc kernel.
#[derive(Clone, Debug)]
pub struct WindowedSinc {
    taps: usize,
    window: KaiserWindow,
    table: WeightTable,
}

impl WindowedSinc {
    /// Make a kernel with `taps` taps, an even number, for signals within `band` cycles per sample.
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

    /// Weights of the `W` samples around a position: with `t = whole + fraction`, sample `whole - W/2 + 1 + i` has
    /// weight `i`.
    #[inline]
    pub fn weights<const W: usize>(&self, fraction: f32) -> [f32; W] {
        self.table.weights(fraction)
    }

    /// Spectrum `H(x)`, by Simpson's rule with steps of a 16th of the window's sidelobes.
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

    /// Relative RMS error for a flat spectrum over `|x| <= band` cycles per sample.
    pub fn error(&self, band: f64) -> f64 {
        let points = 16;
        // H is even, so that half of the band suffices.
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

    /// RMS error of tones over the whole band, interpolated by the defining sum in float64.
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
    fn windowed_sinc_error_matches_prediction_and_documentation() {
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
            // The prediction uses sixteen points of the band, and two images on either side.
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
    fn weight_table_matches_kernel() {
        let kernel = WindowedSinc::new(8, 0.25);
        for i in 0..=100 {
            let fraction = f64::from(i) / 100.0;
            for (j, w) in (0..8).zip(kernel.weights::<8>(fraction as f32)) {
                // h'' is at most pi^2 / 3 plus the window's part: a table step of 1/512 leaves 2e-6.
                let error = f64::from(w) - kernel.at(fraction + 3.0 - f64::from(j));
                assert!(error.abs() < 3e-6, "{fraction} {j} {error}");
            }
        }
    }
}
