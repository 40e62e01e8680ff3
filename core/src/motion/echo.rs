//! Super-resolution of the echoes of one pulse: range and phases of each target from all samples (CLEAN).
//!
//! Targets are estimated one by one with all others subtracted, in three rounds. A target's echo is added back to the
//! residual samples, its range is moved to the maximum of `sum_c |S_c(u)|^2` by Newton steps on the sum itself
//! ([`super::profile`]), its amplitudes are set to `S_c(u)`, and its echo is subtracted again. The window is symmetric
//! about the middle of the band, so the phase of `S_c` is that of the path at that frequency for any error of `u`.
//!
//! With noise of power `s^2` per sample, estimated from the final residual, to first order:
//!
//! ```text
//! SNR = |a|^2 / (s^2 sum w^2),   var(phase) = 1 / (2 SNR),   var(u) = sum w^2 x^2 / (2 SNR sum w^2 (sum w x^2)^2)        sum w = 1
//! ```
//!
//! All channels share the range `u` when a target is subtracted. Receivers `b` apart leave `(kappa b / 2)^2` of its power in its
//! main lobe, `kappa` the RMS wavenumber about the middle of the band: -17 dB for half a wavelength and a fractional bandwidth
//! of 0.4.
//!
//! Distributed clutter and targets beyond the list's capacity count as noise over all ranges.

use core::f64::consts::PI;

use num_complex::Complex32;

use super::setup::Axis;
use crate::Turns;

/// Rounds over all targets. Each round reduces the leakage between targets by the leakage factor.
pub(super) const ROUNDS: u8 = 3;
/// Newton steps per round. The first starts within half a bin of the peak.
const STEPS: usize = 2;
/// Number of frequencies from one directly computed phasor to the next; those in between are rotated.
const ANCHOR: usize = 16;
/// Upper limit of the estimated SNR as a power ratio: samples are float32, and no radar receiver is better.
const MAX_SNR: f32 = 1e9;

/// Target during estimation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate<const CHANNELS: usize> {
    /// Position of the detected peak in cells.
    pub(super) peak_cells: f64,
    cells: f64,
    amplitudes: [Complex32; CHANNELS],
}

/// Estimated range and phases of a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement<const CHANNELS: usize> {
    /// Half of the mean path over all channels in cells, and its standard deviation.
    pub(super) cells: f64,
    pub(super) sigma_cells: f64,
    /// Phase of each channel in radians.
    pub(super) phases_rad: [f64; CHANNELS],
    pub(super) phase_sigma_rad: f64,
    /// SNR of the weakest channel as a power ratio.
    pub(super) least_snr: f32,
}

/// Moments of the window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments {
    /// `sum w^2`.
    squares: f32,
    /// `sum w x^2`.
    curvature: f32,
    /// `sum w^2 x^2`.
    spread: f32,
}

/// `S`, `dS/du` and `d^2S/du^2`.
type Slopes = [Complex32; 3];

impl<const CHANNELS: usize> Candidate<CHANNELS> {
    /// Start at a peak with zero amplitudes.
    pub(super) const fn at(peak_cells: f64) -> Self {
        Self {
            peak_cells,
            cells: peak_cells,
            amplitudes: [Complex32::ZERO; CHANNELS],
        }
    }
}

impl<const CHANNELS: usize> Measurement<CHANNELS> {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        cells: 0.0,
        sigma_cells: 0.0,
        phases_rad: [0.0; CHANNELS],
        phase_sigma_rad: 0.0,
        least_snr: 0.0,
    };

    /// Correct the phases after a range shift by one unambiguous interval. With an even number of frequencies the middle of
    /// the band lies between two samples, so the phase changes by pi.
    pub(super) fn shift_phases(&mut self, frequencies: usize) {
        if frequencies.is_multiple_of(2) {
            for phase in &mut self.phases_rad {
                *phase -= libm::copysign(PI, *phase);
            }
        }
    }
}

impl Moments {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        squares: 0.0,
        curvature: 0.0,
        spread: 0.0,
    };

    pub(super) fn new(weights: &[f32]) -> Self {
        let mut moments = Self::EMPTY;
        for (w, x) in weights.iter().zip(abscissae(weights.len())) {
            moments.squares += w * w;
            moments.curvature += w * x * x;
            moments.spread += w * w * x * x;
        }
        moments
    }
}

/// Abscissae `x_k` of all samples.
fn abscissae(frequencies: usize) -> impl Iterator<Item = f32> {
    let unit = core::f32::consts::PI / frequencies as f32;
    // `2 k - (F - 1)`, exact in float.
    let mut twice = 1.0 - frequencies as f32;
    core::iter::repeat_with(move || {
        let x = twice * unit;
        twice += 2.0;
        x
    })
}

/// Fill `phasors` with `exp(+j x_k u)` for all samples.
fn fill(phasors: &mut [Complex32], cells: f64) {
    let count = phasors.len();
    let half = Turns::from_f64(0.5 * cells / count as f64);
    let step = half.times(2).phasor();
    let mut offset = 1 - count as i64;
    for run in phasors.chunks_mut(ANCHOR) {
        let mut phasor = half.times(offset).phasor();
        for place in run {
            *place = phasor;
            phasor *= step;
        }
        offset += 2 * ANCHOR as i64;
    }
}

/// Residual samples of the channels in use, `F` each, with window and work buffer.
pub(super) struct Residual<'a, const FREQUENCIES: usize> {
    pub(super) axis: &'a Axis,
    pub(super) samples: &'a mut [[Complex32; FREQUENCIES]],
    pub(super) weights: &'a [f32],
    /// Work buffer with one element per weight.
    pub(super) phasors: &'a mut [Complex32],
}

impl<const FREQUENCIES: usize> Residual<'_, FREQUENCIES> {
    /// Refine one target: one step of a round.
    pub(super) fn refine<const CHANNELS: usize>(&mut self, target: &mut Candidate<CHANNELS>) {
        fill(self.phasors, target.cells);
        self.add(target, 1.0);
        for _ in 0..STEPS {
            let mut bends = [0.0; 2];
            for samples in self.samples.iter() {
                let [slope, curvature] = power_derivatives(&self.slopes(samples));
                bends = [bends[0] + slope, bends[1] + curvature];
            }
            let limit = self.axis.cells_a_bin as f32;
            target.cells += f64::from(newton_step(bends[0], bends[1], limit));
            fill(self.phasors, target.cells);
        }
        for (amplitude, samples) in target.amplitudes.iter_mut().zip(self.samples.iter()) {
            *amplitude = self.slopes(samples)[0];
        }
        self.add(target, -1.0);
    }

    /// Noise power per sample in each channel after `targets` targets have been subtracted.
    pub(super) fn noise<const CHANNELS: usize>(&self, targets: usize) -> [f32; CHANNELS] {
        let mut noise = [0.0; CHANNELS];
        // One complex amplitude per target was fitted and reduces the degrees of freedom.
        let free = self.weights.len().saturating_sub(targets).max(1) as f32;
        for (noise, samples) in noise.iter_mut().zip(self.samples.iter()) {
            let own = samples.iter().take(self.weights.len());
            *noise = own.map(Complex32::norm_sqr).sum::<f32>() / free;
        }
        noise
    }

    /// Range, phases and their standard deviations of a target, for the given noise power per sample.
    pub(super) fn measured<const CHANNELS: usize>(
        &mut self,
        target: &Candidate<CHANNELS>,
        noise: &[f32; CHANNELS],
        moments: &Moments,
    ) -> Measurement<CHANNELS> {
        fill(self.phasors, target.cells);
        let mut measurement = Measurement::EMPTY;
        measurement.least_snr = MAX_SNR;
        let (mut inverse, mut off, mut count) = (0.0f32, 0.0f32, 0.0f32);
        let all = self.samples.iter().zip(&target.amplitudes).zip(noise);
        for (((samples, amplitude), noise), phase) in all.zip(&mut measurement.phases_rad) {
            // The target's own echo, which was subtracted, plus the residual of the others.
            let [value, first, second] = self.slopes(samples);
            let top = [
                value + amplitude,
                first,
                second - amplitude * moments.curvature,
            ];
            let [slope, curvature] = power_derivatives(&top);
            off += newton_step(slope, curvature, 0.5);
            let noise = noise * moments.squares;
            let power = top[0].norm_sqr();
            let snr = match noise * MAX_SNR > power {
                true => power / noise,
                false => MAX_SNR,
            };
            measurement.least_snr = measurement.least_snr.min(snr);
            inverse += 1.0 / snr;
            *phase = libm::atan2f(top[0].im, top[0].re).into();
            count += 1.0;
        }
        // Range variance times the SNR.
        let Moments {
            squares,
            curvature,
            spread,
        } = *moments;
        let variance = spread / (2.0 * squares * curvature * curvature);
        measurement.cells = target.cells + f64::from(off / count);
        measurement.sigma_cells = f64::from(libm::sqrtf(variance * inverse) / count);
        measurement.phase_sigma_rad = f64::from(libm::sqrtf(0.5 * inverse / count));
        measurement
    }

    fn slopes(&self, samples: &[Complex32; FREQUENCIES]) -> Slopes {
        let mut sums = [Complex32::ZERO; 3];
        let [value, first, second] = &mut sums;
        let each = samples.iter().zip(self.phasors.iter()).zip(self.weights);
        for (((z, phasor), w), x) in each.zip(abscissae(self.weights.len())) {
            let own = z * phasor * *w;
            let leaned = own * x;
            *value += own;
            *first += Complex32::new(-leaned.im, leaned.re);
            *second -= leaned * x;
        }
        sums
    }

    /// Add a target's echo times `sign`. `phasors` must be those of its range.
    fn add<const CHANNELS: usize>(&mut self, target: &Candidate<CHANNELS>, sign: f32) {
        for (samples, amplitude) in self.samples.iter_mut().zip(&target.amplitudes) {
            let own = amplitude * sign;
            for (z, phasor) in samples.iter_mut().zip(self.phasors.iter()) {
                *z += own * phasor.conj();
            }
        }
    }
}

/// First and second derivative of `|S|^2 / 2`.
fn power_derivatives(&[value, first, second]: &Slopes) -> [f32; 2] {
    [
        (value.conj() * first).re,
        first.norm_sqr() + (value.conj() * second).re,
    ]
}

/// Newton step towards the maximum, limited to `limit`.
fn newton_step(slope: f32, curvature: f32, limit: f32) -> f32 {
    match curvature < 0.0 {
        true => (-slope / curvature).max(-limit).min(limit),
        false if slope == 0.0 => 0.0,
        false => libm::copysignf(limit, slope),
    }
}
