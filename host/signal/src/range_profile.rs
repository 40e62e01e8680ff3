//! Range profiles, upsampled by zero padding and prefiltered for spline interpolation.
//!
//! ```text
//! profile(l) = sum_k a[k] exp(+j 2 pi (k - K/2) l / L),   path(l) = l c / (L step_hz),   a[k] = w[k] z[k] / sinc^(d+1)((k - K/2) / L)
//! value(t)   = sum_l profile(l) B(t - l),                 B the cardinal B-spline of degree d
//! ```
//!
//! where `L >= oversampling * K` (Schone 2020, chapter 2 and 5.1; degree 1 is linear interpolation). The carrier at
//! sample `K/2` is removed, so that the profile is smooth; image formers restore it.
//!
//! A spline of degree `d` multiplies the spectral component `x = (k - K/2) / L` by `sinc^(d+1)(x)` and adds images at
//! `x + i`. Prior division by `sinc^(d+1)` leaves only the images. The image at `x + i` has the amplitude `(x / (x +
//! i))^(d+1)`, so that the relative RMS error of one component is about `sqrt(2) x^(d+1)`. It is largest at the band's
//! edge, `|x| = 1 / (2 u)` with `u = L / K`, which bounds the error for any spectrum and is the error given here. For a
//! flat spectrum it is `10 log10(2 d + 3)` dB lower, and lower still with a window. An error of -62 dB at the edge
//! needs a `u` of 21.5 for linear interpolation, 6.2 for degree 2, 3.5 for degree 3 and 2.6 for degree 4. Without the
//! division, linear interpolation of a flat spectrum has -44, -48 and -56 dB for a `u` of 8, 10 and 16, instead of -52,
//! -56 and -64: `(pi x)^2 / 3` of the component itself is lost as well (Schone uses 10).
//!
//! Layout: `L + 1` values, the last equal to the first, so that linear interpolation need not wrap. Cost: one FFT of
//! length `L` per pulse.

use std::f64::consts::PI;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::fast_length::fastest_length;

/// Transform of pulses into upsampled range profiles of one length.
pub struct RangeProfiler {
    degree: i32,
    /// Window divided by the spline's response, one weight per frequency.
    weights: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
}

/// Highest upsampling factor: -150 dB with linear interpolation.
const MAX_OVERSAMPLING: f64 = 8192.0;

/// Relative RMS error, over all images, of the component at `x` cycles per value (below 1/2), interpolated by a spline
/// of degree `degree`.
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
    /// Make a profiler for pulses of `window.len()` samples, upsampled by at least `oversampling` (1 or more), for
    /// interpolation by splines of degree `degree`.
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

    /// Length of the profiles of pulses with `count` samples.
    pub fn length_for(count: usize, oversampling: f64) -> usize {
        fastest_length((count as f64 * oversampling.max(1.0)).ceil() as usize)
    }

    /// Smallest upsampling factor for which interpolation by splines of this degree has an error of at most `error_db`
    /// for any spectrum.
    pub fn oversampling_for(degree: usize, error_db: f64) -> f64 {
        let error = libm::pow(10.0, error_db / 20.0);
        let good = |oversampling: f64| component_error(degree as i32, 0.5 / oversampling) <= error;
        // The error decreases with upsampling.
        let (mut low, mut high) = (1.0f64, MAX_OVERSAMPLING);
        while high > low * 1.001 {
            let middle = (low * high).sqrt();
            match good(middle) {
                true => high = middle,
                false => low = middle,
            }
        }
        high
    }

    /// Largest relative RMS interpolation error for any spectrum: that at the band's edge.
    pub fn error(&self) -> f64 {
        // `K / 2` samples lie before the centre, as many or one fewer after it.
        let edge = (self.weights.len() / 2) as f64 / self.length() as f64;
        component_error(self.degree, edge)
    }

    /// Relative RMS error of float32 arithmetic: of the transform, and of the carrier phase restored by the profile's
    /// reader ([`super::phase::phasor32`]).
    pub fn rounding(&self) -> f64 {
        6e-8 * libm::log2(self.length() as f64).max(1.0).sqrt() + 1e-7
    }

    /// Number of values of a profile, without the repeated first one.
    #[inline]
    pub fn length(&self) -> usize {
        self.fft.len()
    }

    /// Number of complex scratch values required by [`Self::profile`].
    pub fn scratch_length(&self) -> usize {
        self.fft.get_inplace_scratch_len()
    }

    /// Compute the profile of one pulse into `profile` (`length() + 1` values).
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
        // Sample `K/2` is first; the samples before it are last.
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

    /// Error of the interpolated profile of a single scatterer with `window`, against the plain sum.
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

    /// Cardinal B-spline of degree `degree`, by its recurrence.
    fn spline(degree: usize, x: f64) -> f64 {
        if degree == 0 {
            return f64::from(u8::from((-0.5..0.5).contains(&x)));
        }
        let (d, half) = (degree as f64, (degree as f64 + 1.0) / 2.0);
        let below = |x| spline(degree - 1, x);
        ((half + x) * below(x + 0.5) + (half - x) * below(x - 0.5)) / d
    }

    #[test]
    fn spline_interpolation_error_matches_derivation() {
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
            // Lengths are rounded up by at most a quarter: 2 dB per degree and 2 dB, and half as much again where
            // images are close; with 51 samples the band's edges are 2 % inside half a cycle.
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
        // Figures of the module's head.
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
