//! Range profiles, upsampled by zero padding and made for linear interpolation.
//!
//! ```text
//! profile(l) = sum_k a[k] exp(+j 2 pi (k - K/2) l / L),   path(l) = l c / (L step_hz),   a[k] = w[k] z[k] / sinc^2((k - K/2) / L)
//! ```
//!
//! with `L >= oversampling * K` (Schone 2020, chapter 2 and 5.1). The carrier at sample `K/2` is left
//! out, so the profile is smooth; the former puts it back.
//!
//! Linear interpolation multiplies spectral component `x = (k - K/2) / L` by `sinc^2(x)` and adds
//! images at `x + i`. Dividing by `sinc^2` first leaves the images alone: the two strongest have
//! `(x / (1 +- x))^2`, so the relative RMS error of one component is `sqrt(2) x^2`: at the band's edge,
//! `|x| = 1 / (2 u)` with `u = L / K`, it is `sqrt(2) / (4 u^2)`, which no spectrum exceeds. A flat
//! spectrum has `E[x^4] = x_max^4 / 5` and reads 7 dB less: -52 dB at 8, -56 dB at 10, -64 dB at 16.
//! Without the division it would be -44, -48 and -56 dB: `(pi x)^2 / 3` of the component itself is lost
//! as well (Schone uses 10).
//!
//! Layout: `L + 1` values, the last equal to the first, so that interpolation need not wrap twice.
//! Cost: one transform of length `L` a pulse.

use std::f64::consts::PI;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft as fft;
use subaperture_fft::Fft;

use super::fast_length::fast_length;

/// Makes upsampled range profiles of one length.
pub struct RangeProfiler {
    /// Window over pre-emphasis, one a frequency.
    weights: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
}

impl RangeProfiler {
    /// For pulses of `window.len()` samples, upsampled at least `oversampling` times (1 or more).
    pub fn new(window: &[f64], oversampling: f64) -> Self {
        let count = window.len();
        let length = fast_length((count as f64 * oversampling.max(1.0)).ceil() as usize);
        let emphasised = |(k, w): (usize, &f64)| {
            let x = PI * (k as f64 - (count / 2) as f64) / length as f64;
            let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
            (w / (sinc * sinc)) as f32
        };
        Self {
            weights: window.iter().enumerate().map(emphasised).collect(),
            fft: fft::inverse(length),
        }
    }

    /// The smallest upsampling whose error is at most `error_db` whatever the spectrum; at least 2.
    pub fn oversampling_for(error_db: f64) -> f64 {
        // 1 dB for the images beyond the two strongest and the terms beyond x^2.
        let error = 10f64.powf((error_db - 1.0) / 20.0);
        (2f64.sqrt() / (4.0 * error)).sqrt().max(2.0)
    }

    /// Largest relative RMS error of interpolation of any spectrum: that of the band's edge, all images
    /// counted.
    pub fn error(&self) -> f64 {
        // `K / 2` samples lie before the centre, as many or one less after it.
        let edge = (self.weights.len() / 2) as f64 / self.length() as f64;
        let images = (1..=20).map(f64::from);
        let power: f64 = images
            .map(|i| (edge / (i - edge)).powi(4) + (edge / (i + edge)).powi(4))
            .sum();
        power.sqrt()
    }

    /// Relative RMS error of the arithmetic in float32: of the transform, and of the phase that a profile's reader
    /// puts back ([`super::phase::phasor32`]).
    pub fn rounding(&self) -> f64 {
        6e-8 * (self.length() as f64).log2().max(1.0).sqrt() + 1e-7
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
        profile.fill(Complex32::ZERO);
        for (k, (z, w)) in pulse.iter().zip(&self.weights).enumerate() {
            profile[(k + length - count / 2) % length] = z * w;
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
    fn error_db(window: &[f64], oversampling: f64) -> f64 {
        let count = window.len();
        let profiler = RangeProfiler::new(window, oversampling);
        let length = profiler.length();
        let pulse: Vec<Complex32> = (0..count)
            .map(|k| {
                let z = phasor(-0.3777 * (k as f64 - 25.0));
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
            let (i, t) = (l.floor() as usize, l.fract() as f32);
            let got = profile[i] + (profile[i + 1] - profile[i]) * t;
            let expected: Complex64 = (0..count)
                .map(|k| phasor((u - 0.3777) * (k as f64 - 25.0)) * window[k])
                .sum();
            error += (Complex64::new(got.re.into(), got.im.into()) - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        10.0 * (error / power).log10()
    }

    #[test]
    fn the_error_is_the_derived_one() {
        let flat = vec![1.0; 51];
        let mut edges = vec![0.0; 51];
        (edges[0], edges[50]) = (1.0, 1.0);
        for bound_db in [-40.0, -50.0, -60.0, -65.0] {
            let oversampling = RangeProfiler::oversampling_for(bound_db);
            // Lengths are rounded up by 7 % at most, 1.2 dB, and 1 dB is kept for the other images.
            let at_edges = error_db(&edges, oversampling);
            assert!(
                at_edges < bound_db && at_edges > bound_db - 3.0,
                "{bound_db}: {at_edges}"
            );
            let predicted = 20.0 * RangeProfiler::new(&edges, oversampling).error().log10();
            // 51 samples: one edge lies 2 % further out than the other, 0.3 dB in the mean of both.
            assert!((predicted - at_edges).abs() < 0.5, "{predicted} {at_edges}");
            let at_flat = error_db(&flat, oversampling);
            assert!(
                (at_flat - at_edges + 7.0).abs() < 0.5,
                "{bound_db}: {at_flat} {at_edges}"
            );
        }
    }
}
