//! Transforms between time of arrival and frequency, one vector at a time, in float64.
//!
//! With `SGN = -1` and `K` frequencies `f_m = fx_C + m spacing`, `spacing = 1 / (N SCSS)`, the integral in the [CPHD
//! module](super) becomes
//!
//! ```text
//! s[i] = 1/K sum_m S[m] exp(+j 2 pi m spacing (SC0 + i SCSS))        i = 0 .. N-1
//! S[m] = K/N sum_i s[i] exp(-j 2 pi m spacing (SC0 + i SCSS))
//! ```
//!
//! which invert each other exactly if the `m` are distinct modulo `N`. `m` runs over the bins with
//! `FX1 <= f_m < FX2`; the band is symmetric about `fx_C`, so the half-open interval holds `K` bins
//! for a band of `K` spacings, `K` even or odd: `m` from `-floor(K/2)`.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use subaperture_fft::Fft;
use subaperture_signal::phase::phasor;

/// Tolerance in bins when a band is compared with the bins: above the rounding of FX1 and FX2 (1e-6 Hz at 10 GHz),
/// far below one bin.
const BIN_TOLERANCE: f64 = 1e-3;

/// Frequency bins of a band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bins {
    pub(super) first: i64,
    pub(super) count: usize,
}

impl Bins {
    /// Bins of a band of `bandwidth_hz` for `num_toa` samples spaced `scss_s`. `None` if there are no bins, or more
    /// than samples.
    pub(super) fn of_band(bandwidth_hz: f64, scss_s: f64, num_toa: usize) -> Option<Self> {
        let half = bandwidth_hz * scss_s * num_toa as f64 / 2.0;
        if !(half >= 0.0 && half <= num_toa as f64) {
            return None;
        }
        let first = (-half - BIN_TOLERANCE).ceil() as i64;
        let end = (half - BIN_TOLERANCE).ceil() as i64;
        let count = usize::try_from(end - first).ok()?;
        (1..=num_toa)
            .contains(&count)
            .then_some(Self { first, count })
    }

    /// Bins of `count` frequencies around `fx_C`.
    pub(super) fn of_count(count: usize) -> Self {
        Self {
            first: -((count / 2) as i64),
            count,
        }
    }
}

/// Transforms between vectors of `num_toa` samples and of `bins.count` frequencies.
pub(super) struct Transform {
    bins: Bins,
    num_toa: usize,
    fft: Arc<dyn Fft<f64>>,
    buffer: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Transform {
    /// `fft` is forward for [`Self::frequency`], inverse for [`Self::arrival`].
    pub(super) fn new(bins: Bins, fft: Arc<dyn Fft<f64>>) -> Self {
        Self {
            bins,
            num_toa: fft.len(),
            buffer: vec![Complex64::ZERO; fft.len()],
            scratch: vec![Complex64::ZERO; fft.get_inplace_scratch_len()],
            fft,
        }
    }

    /// FX samples of a vector from its TOA samples. `shift` is `SC0 / (N SCSS)`.
    pub(super) fn frequency(&mut self, toa: &[Complex32], shift: f64, fx: &mut [Complex32]) {
        for (z, s) in self.buffer.iter_mut().zip(toa) {
            *z = Complex64::new(f64::from(s.re), f64::from(s.im));
        }
        self.fft
            .process_with_scratch(&mut self.buffer, &mut self.scratch);
        let scale = self.bins.count as f64 / self.num_toa as f64;
        for (k, z) in fx.iter_mut().enumerate() {
            let m = self.bins.first + k as i64;
            let turned = self.buffer[self.bin(m)] * phasor(-(m as f64) * shift) * scale;
            *z = Complex32::new(turned.re as f32, turned.im as f32);
        }
    }

    /// TOA samples of a vector from its FX samples; the inverse of [`Self::frequency`].
    pub(super) fn arrival(&mut self, fx: &[Complex32], shift: f64, toa: &mut [Complex32]) {
        self.buffer.fill(Complex64::ZERO);
        for (k, s) in fx.iter().enumerate() {
            let m = self.bins.first + k as i64;
            let bin = self.bin(m);
            self.buffer[bin] =
                Complex64::new(f64::from(s.re), f64::from(s.im)) * phasor(m as f64 * shift);
        }
        self.fft
            .process_with_scratch(&mut self.buffer, &mut self.scratch);
        let scale = 1.0 / self.bins.count as f64;
        for (z, s) in toa.iter_mut().zip(&self.buffer) {
            *z = Complex32::new((s.re * scale) as f32, (s.im * scale) as f32);
        }
    }

    fn bin(&self, m: i64) -> usize {
        m.rem_euclid(self.num_toa as i64) as usize
    }
}
