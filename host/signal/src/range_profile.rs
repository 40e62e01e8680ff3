//! Range profiles, upsampled by zero padding and made to be read as splines.
//!
//! ```text
//! profile(l) = sum_k a[k] exp(+j 2 pi (k - K/2) l / L),   path(l) = l c / (L step_hz),   a[k] = w[k] z[k] / sinc^(d+1)((k - K/2) / L)
//! value(t)   = sum_l profile(l) B(t - l),                 B the cardinal B-spline of degree d
//! ```
//!
//! with `L >= oversampling * K` (Schone 2020, chapter 2 and 5.1; of degree 1 this is linear interpolation). The carrier at sample `K/2`
//! is left out, so the profile is smooth; the former puts it back.
//!
//! A spline of degree `d` multiplies spectral component `x = (k - K/2) / L` by `sinc^(d+1)(x)` and adds
//! images at `x + i`. Dividing by `sinc^(d+1)` first leaves the images alone: that at `x + i` has
//! `(x / (x + i))^(d+1)`, so the relative RMS error of one component is about `sqrt(2) x^(d+1)`; it is largest at the band's edge,
//! `|x| = 1 / (2 u)` with `u = L / K`, which no spectrum exceeds, and that is the error given here. A flat
//! spectrum reads `10 log10(2 d + 3)` dB less, with a window still less. For -62 dB at the edge linear interpolation takes an
//! `u` of 21.5, degree 2 of 6.2, degree 3 of 3.5 and degree 4 of 2.6. Without the division linear interpolation of a flat spectrum would have
//! -44, -48 and -56 dB at 8, 10 and 16, in place of -52, -56 and -64: `(pi x)^2 / 3` of the component itself is lost as well (Schone
//! uses 10).
//!
//! Layout: `L + 1` values, the last equal to the first, so that linear interpolation need not wrap twice.
//! Cost: one transform of length `L` a pulse.

use std::f64::consts::PI;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::fast_length::fastest_length;

/// Makes upsampled range profiles of one length.
pub struct RangeProfiler {
    degree: i32,
    /// Window over pre-emphasis, one a frequency.
    weights: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
}

/// Finest upsampling: that of -150 dB by linear interpolation.
const MOST_OVERSAMPLING: f64 = 8192.0;

/// Relative RMS error of the component at `x` cycles a value, below 1/2, read by a spline of degree `d`: all images counted.
fn component_error(degree: i32, x: f64) -> f64 {
    let images = (1..=20).map(f64::from);
    let power: f64 = images
        .map(|i| {
            let before = (x / (i - x)).powi(2 * degree + 2);
            before + (x / (i + x)).powi(2 * degree + 2)
        })
        .sum();
    power.sqrt()
}

impl RangeProfiler {
    /// For pulses of `window.len()` samples, upsampled at least `oversampling` times (1 or more), read as splines of this degree.
    pub fn new(degree: usize, window: &[f64], oversampling: f64, transforms: Transforms) -> Self {
        let count = window.len();
        let length = Self::length_for(count, oversampling);
        let degree = degree as i32;
        let emphasised = |(k, w): (usize, &f64)| {
            let x = PI * (k as f64 - (count / 2) as f64) / length as f64;
            let sinc = if x == 0.0 { 1.0 } else { libm::sin(x) / x };
            (w / sinc.powi(degree + 1)) as f32
        };
        Self {
            degree,
            weights: window.iter().enumerate().map(emphasised).collect(),
            fft: transforms.inverse(length),
        }
    }

    /// The length of profiles of pulses of `count` samples.
    pub fn length_for(count: usize, oversampling: f64) -> usize {
        fastest_length((count as f64 * oversampling.max(1.0)).ceil() as usize)
    }

    /// The smallest upsampling at which splines of this degree err by at most `error_db` whatever the spectrum.
    pub fn oversampling_for(degree: usize, error_db: f64) -> f64 {
        let error = libm::pow(10.0, error_db / 20.0);
        let good = |oversampling: f64| component_error(degree as i32, 0.5 / oversampling) <= error;
        // Errors fall with upsampling.
        let (mut low, mut high) = (1.0f64, MOST_OVERSAMPLING);
        while high > low * 1.001 {
            let middle = (low * high).sqrt();
            match good(middle) {
                true => high = middle,
                false => low = middle,
            }
        }
        high
    }

    /// Largest relative RMS error of interpolation of any spectrum: that of the band's edge.
    pub fn error(&self) -> f64 {
        // `K / 2` samples lie before the centre, as many or one less after it.
        let edge = (self.weights.len() / 2) as f64 / self.length() as f64;
        component_error(self.degree, edge)
    }

    /// Relative RMS error of the arithmetic in float32: of the transform, and of the phase that a profile's reader
    /// puts back ([`super::phase::phasor32`]).
    pub fn rounding(&self) -> f64 {
        6e-8 * libm::log2(self.length() as f64).max(1.0).sqrt() + 1e-7
    }

    /// Values in a profile, the repeated first one not counted.
    #[inline]
    pub fn length(&self) -> usize {
        self.fft.len()
    }

    /// Complex values of scratch that [`Self::profile`] needs.
    pub fn scratch_length(&self) -> usize {
        self.fft.get_inplace_scratch_len()
    }

    /// The profile of one pulse into `profile` (`length() + 1` values).
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn profile(
        &self,
        pulse: &[Complex32],
        profile: &mut [Complex32],
        scratch: &mut [Complex32],
    ) {
        let (count, length) = (self.weights.len(), self.length());
        assert!(pulse.len() == count && profile.len() == length + 1);
        // Sample `K/2` comes first, those before it last.
        let (before, after) = pulse.split_at(count / 2);
        let (weights_before, weights_after) = self.weights.split_at(count / 2);
        let (start, rest) = profile.split_at_mut(after.len());
        let (between, end) = rest[..length - after.len()].split_at_mut(length - count);
        between.fill(Complex32::ZERO);
        for (to, samples, weights) in [(start, after, weights_after), (end, before, weights_before)]
        {
            for ((to, z), w) in to.iter_mut().zip(samples).zip(weights) {
                *to = z * w;
            }
        }
        self.fft
            .process_with_scratch(&mut profile[..length], scratch);
        profile[length] = profile[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::phasor;
    use num_complex::Complex64;

    /// Interpolated profile of a lone scatterer, seen through `window`, against the plain sum.
    fn error_db(degree: usize, window: &[f64], oversampling: f64) -> f64 {
        let count = window.len();
        let profiler = RangeProfiler::new(degree, window, oversampling, Transforms::Fastest);
        let length = profiler.length();
        let pulse: Vec<Complex32> = (0..count)
            .map(|k| {
                let z = phasor(-0.3777 * (k as f64 - (count / 2) as f64));
                Complex32::new(z.re as f32, z.im as f32)
            })
            .collect();
        let mut profile = vec![Complex32::ZERO; length + 1];
        let mut scratch = vec![Complex32::ZERO; profiler.scratch_length()];
        profiler.profile(&pulse, &mut profile, &mut scratch);
        let (mut error, mut power) = (0.0, 0.0);
        for i in 0..4000 {
            let u = (f64::from(i) * 0.618_034).fract();
            let l = u * length as f64;
            let around = (-3..=3).map(|i| l.floor() as i64 + i);
            let got: Complex64 = around
                .map(|i| {
                    let value = profile[i.rem_euclid(length as i64) as usize];
                    let value = Complex64::new(value.re.into(), value.im.into());
                    value * spline(degree, l - i as f64)
                })
                .sum();
            let expected: Complex64 = (0..count)
                .map(|k| phasor((u - 0.3777) * (k as f64 - (count / 2) as f64)) * window[k])
                .sum();
            error += (got - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        10.0 * (error / power).log10()
    }

    /// The cardinal B-spline of degree `d`, by its recurrence.
    fn spline(degree: usize, x: f64) -> f64 {
        if degree == 0 {
            return f64::from(u8::from((-0.5..0.5).contains(&x)));
        }
        let (d, half) = (degree as f64, (degree as f64 + 1.0) / 2.0);
        let below = |x| spline(degree - 1, x);
        ((half + x) * below(x + 0.5) + (half - x) * below(x - 0.5)) / d
    }

    #[test]
    fn the_error_is_the_derived_one() {
        let flat = vec![1.0; 51];
        let mut edges = vec![0.0; 51];
        (edges[0], edges[50]) = (1.0, 1.0);
        for (degree, bound_db) in [
            (1, -40.0),
            (1, -50.0),
            (1, -65.0),
            (2, -40.0),
            (2, -75.0),
            (3, -50.0),
            (3, -90.0),
            (4, -60.0),
            (4, -100.0),
        ] {
            let oversampling = RangeProfiler::oversampling_for(degree, bound_db);
            // Lengths are rounded up by a quarter at most: 2 dB a degree and 2, and half as much again where images are near; 51 samples
            // have edges 2 % further in than half a cycle.
            let at_edges = error_db(degree, &edges, oversampling);
            let order = degree as f64 + 1.0;
            assert!(
                at_edges < bound_db + 0.1 && at_edges > bound_db - 3.0 * order - 0.4,
                "{degree} {bound_db}: {at_edges}"
            );
            let profiler = RangeProfiler::new(degree, &edges, oversampling, Transforms::Fastest);
            let predicted = 20.0 * profiler.error().log10();
            assert!(
                (predicted - at_edges).abs() < 0.2,
                "{degree} {bound_db}: {predicted} {at_edges}"
            );
            let at_flat = error_db(degree, &flat, oversampling);
            let less_db = 10.0 * (2.0 * order + 1.0).log10();
            assert!(
                (at_flat - at_edges + less_db).abs() < 0.4 * order,
                "{degree} {bound_db}: {at_flat} {at_edges}"
            );
        }
        // As the head of this file says.
        for (upsampling, expected_db) in [(8.0, -52.0), (10.0, -56.0), (16.0, -64.0)] {
            let got = error_db(1, &flat, upsampling);
            assert!((got - expected_db).abs() < 1.5, "{upsampling}: {got}");
        }
        for (degree, expected) in [(1, 21.5), (2, 6.2), (3, 3.5), (4, 2.6)] {
            let got = RangeProfiler::oversampling_for(degree, -62.0);
            assert!((got / expected - 1.0).abs() < 0.03, "{degree}: {got}");
        }
    }
}
