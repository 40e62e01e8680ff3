//! Demodulation of the tone sent at every carrier, and the quotient of the two channels; C (5.4) to (5.11).
//!
//! The tone has a whole number `P` of samples per period. For channel `c` and a block `b` of whole periods, the mean is
//!
//! ```text
//! x_c[b] = mean over the block of s_c[i] exp(-j 2 pi i / P)
//! ```
//!
//! DC offset and the image due to IQ imbalance, at `-f_0`, average to zero. The block means of both channels still
//! rotate with the synthesisers' phases and LO offset. Both cancel in the least-squares quotient
//!
//! ```text
//! z = sum_b x_1[b] conj(x_0[b]) / sum_b |x_0[b]|^2
//! ```
//!
//! A block lasts at most a quarter of a millisecond ([`LONGEST_BLOCK_S`]), for bursts of any length. An LO offset `d`
//! reduces the mean over `T` seconds by `sinc(d T)`, and rotates it by `d T` turns from block to block. An offset of 1
//! kHz, more than that of two synthesisers of a B210, costs a tenth of the amplitude and rotates by a quarter of a
//! turn, half of the limit of phase unwrapping. With blocks of a sixteenth of a 20 ms dwell, an offset of 800 Hz would
//! average to zero.
//!
//! Neglected: an LO offset `d` within a block of `T` seconds reduces both channels equally, which cancels, and lets a
//! fraction `d / f_0` of DC and image through (1 kHz of 125 kHz: -42 dB of their level). Reference noise `n`, relative
//! to the reference, biases `z` low by the fraction `n / blocks`. Cost: two complex products per sample.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex32, Complex64};
use subaperture_signal::phase::phasor;

use crate::transceiver::Sample;

/// Minimum number of blocks of a burst, if it has enough periods.
pub const BLOCKS: usize = 16;
/// Maximum duration of a block, seconds, unless a period is longer.
pub const LONGEST_BLOCK_S: f64 = 0.25e-3;

/// Tone with a whole number of samples per period.
#[derive(Clone, Debug)]
pub struct Tone {
    turns: Vec<Complex64>,
    /// Maximum number of periods per block.
    most_periods: usize,
}

/// Result of demodulating one burst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixed {
    /// Echo divided by reference.
    pub value: Complex64,
    /// Echo alone, demodulated by the transmitted tone, without a reference.
    pub unreferred: Complex64,
    /// Variance of `value`, estimated from the scatter of the blocks; 0 for a single block.
    pub variance: f64,
    /// RMS of the reference, relative to full scale.
    pub reference: f64,
    /// Fraction of the blocks without lost samples.
    pub whole: f64,
    /// Deviation of the reference's blocks from a steady tone: the larger of the relative amplitude error and the phase
    /// error in radians.
    pub unsteady: f64,
}

impl Tone {
    /// Make a tone of `period` samples at `rate_hz` samples per second. The period is at least 3, since a tone of 2
    /// samples equals its image.
    ///
    /// # Panics
    /// If `period` is below 3.
    pub fn new(period: usize, rate_hz: f64) -> Self {
        assert!(
            period >= 3,
            "tone period of {period} samples: expected at least 3"
        );
        let turns = (0..period)
            .map(|i| phasor(i as f64 / period as f64))
            .collect();
        Self {
            turns,
            // `as` converts NaN to 0.
            most_periods: (LONGEST_BLOCK_S * rate_hz / period as f64) as usize,
        }
    }

    /// Number of samples per period.
    pub fn period(&self) -> usize {
        self.turns.len()
    }

    /// One period of the transmitted waveform.
    pub fn waveform(&self, amplitude: f64) -> Vec<Complex32> {
        let scale =
            |z: &Complex64| Complex32::new((z.re * amplitude) as f32, (z.im * amplitude) as f32);
        self.turns.iter().map(scale).collect()
    }

    /// Demodulated mean `x_c` of a block, relative to full scale.
    fn mean(&self, samples: &[Sample]) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for period in samples.chunks_exact(self.period()) {
            for (s, turn) in period.iter().zip(&self.turns) {
                sum += Complex64::new(f64::from(s.re), f64::from(s.im)) * turn.conj();
            }
        }
        sum / (samples.len() as f64 * 32768.0)
    }

    /// First sample of `reference` from which on every burst of `window` samples is steady within `steady`; `None` if
    /// the last such burst is not.
    pub(crate) fn steady_from(
        &self,
        reference: &[Sample],
        window: usize,
        steady: f64,
    ) -> Option<usize> {
        let block = self.block(window);
        let means = reference.chunks_exact(block).map(|part| self.mean(part));
        let blocks: Vec<(usize, Complex64)> = means.enumerate().collect();
        let count = (window / block).max(1);
        let unsteady = |burst: &[(usize, Complex64)]| {
            burst.iter().any(|(_, x)| *x == Complex64::ZERO) || unsteadiness(burst) > steady
        };
        let first = match blocks.windows(count).rposition(unsteady) {
            Some(last) => last + 1,
            None => 0,
        };
        (first + count <= blocks.len()).then_some(first * block)
    }

    /// Samples per block of a burst of `samples`, over which [`Mixed::unsteady`] averages.
    pub(crate) fn block(&self, samples: usize) -> usize {
        let periods = samples / self.period() / BLOCKS;
        periods.min(self.most_periods).max(1) * self.period()
    }

    /// Demodulate a burst of reference and echo channels. Returns `None` if every block has lost samples or the
    /// reference is zero.
    pub fn mix(&self, channels: [&[Sample]; 2], lost: &[Range<usize>]) -> Option<Mixed> {
        let length = channels[0].len().min(channels[1].len());
        let block = self.block(length);
        let (mut cross, mut power, mut alone) = (Complex64::ZERO, 0.0, Complex64::ZERO);
        let (mut reference, mut echo_power) = (Vec::with_capacity(2 * BLOCKS), 0.0);
        let blocks = length / block;
        for b in 0..blocks {
            let at = b * block..(b + 1) * block;
            if lost
                .iter()
                .any(|gap| gap.start < at.end && at.start < gap.end)
            {
                continue;
            }
            let [x0, x1] = channels.map(|channel| self.mean(&channel[at.clone()]));
            cross += x1 * x0.conj();
            power += x0.norm_sqr();
            echo_power += x1.norm_sqr();
            alone += x1;
            reference.push((b, x0));
        }
        if power <= 0.0 {
            return None;
        }
        let count = reference.len() as f64;
        // Residual of the quotient over the blocks, `sum |x_1 - z x_0|^2`.
        let left = (echo_power - cross.norm_sqr() / power).max(0.0);
        Some(Mixed {
            value: cross / power,
            variance: left / ((count - 1.0).max(1.0) * power),
            unreferred: alone / count,
            reference: (power / count).sqrt(),
            whole: count / blocks as f64,
            unsteady: unsteadiness(&reference),
        })
    }
}

/// Deviation of blocks from a tone of constant amplitude and frequency: the larger of the greatest relative amplitude
/// deviation from the mean, and the greatest phase deviation in radians from a straight line through all blocks. Noise
/// alone gives about `2 / sqrt(SNR)`, with the SNR of a block.
fn unsteadiness(blocks: &[(usize, Complex64)]) -> f64 {
    let n = blocks.len() as f64;
    let mean = blocks.iter().map(|(_, x)| x.norm()).sum::<f64>() / n;
    let amplitude = blocks
        .iter()
        .map(|(_, x)| (x.norm() / mean - 1.0).abs())
        .fold(0.0, f64::max);
    // Unwrapped phases: between neighbouring blocks the LO offset never rotates by more than half a turn.
    let mut phases = Vec::with_capacity(blocks.len());
    let mut phase = 0.0;
    let mut before = blocks[0].1;
    for &(b, x) in blocks {
        let turn = x * before.conj();
        phase += libm::atan2(turn.im, turn.re);
        before = x;
        phases.push((b as f64, phase));
    }
    let centre = |part: fn(&(f64, f64)) -> f64| phases.iter().map(part).sum::<f64>() / n;
    let (b0, p0) = (centre(|p| p.0), centre(|p| p.1));
    let spread: f64 = phases.iter().map(|(b, _)| (b - b0) * (b - b0)).sum();
    let slope = match spread {
        0.0 => 0.0,
        _ => phases.iter().map(|(b, p)| (b - b0) * (p - p0)).sum::<f64>() / spread,
    };
    let off = |(b, p): &(f64, f64)| (p - p0 - slope * (b - b0)).abs();
    let phase = phases.iter().map(off).fold(0.0, f64::max);
    debug_assert!(phase <= TAU * n, "phases are sums of arguments");
    amplitude.max(phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(z: Complex64) -> Sample {
        Sample::new(
            (z.re * 32768.0).round() as i16,
            (z.im * 32768.0).round() as i16,
        )
    }

    /// A reference and a scaled copy as the echo, with DC, an image, and an LO offset of 900 Hz at 1 MS/s. DC of 0.02
    /// and image of 0.03 leak by 900 / 125000 each, with some phase: below 5e-4 of 0.5, and five times as much relative
    /// to the echo of 0.1. Rounding to counts: 1e-5.
    #[test]
    fn channel_quotient_cancels_phase_lo_offset_dc_and_image() {
        let tone = Tone::new(8, 1e6);
        let ratio = Complex64::from_polar(0.2, 1.1);
        for start in [0.0, 0.3, 0.77] {
            let both: [Vec<Sample>; 2] = [Complex64::ONE, ratio].map(|scale| {
                let sample = |i: usize| {
                    let turns = i as f64 / 8.0 + 900e-6 * i as f64 + start;
                    let z = scale * phasor(turns) * 0.5;
                    counts(z + z.conj() * 0.03 + Complex64::new(0.02, -0.01))
                };
                (0..1000).map(sample).collect()
            });
            let mixed = tone.mix([&both[0], &both[1]], &[]).unwrap();
            assert!(
                (mixed.value - ratio).norm() < 2.5e-3 * ratio.norm(),
                "{}",
                mixed.value
            );
            assert!((mixed.reference - 0.5).abs() < 5e-3);
            assert!(mixed.unsteady < 5e-3, "{}", mixed.unsteady);
            assert_eq!(mixed.whole, 1.0);
        }
    }

    /// LO offset of 800 Hz over 20 ms: a sixteenth of the burst is one whole turn, with a mean of zero. Blocks of 0.25
    /// ms lose `1 - sinc(0.2)`, 6 %, of both channels equally. DC and image leak by 800 of 125000, and less after
    /// averaging over 80 blocks with all phases.
    #[test]
    fn long_dwell_keeps_accuracy_with_lo_offset() {
        let tone = Tone::new(8, 1e6);
        let ratio = Complex64::from_polar(0.2, 1.1);
        let both: [Vec<Sample>; 2] = [Complex64::ONE, ratio].map(|scale| {
            let sample = |i: usize| {
                let z = scale * phasor(i as f64 / 8.0 + 800e-6 * i as f64) * 0.5;
                counts(z + z.conj() * 0.03 + Complex64::new(0.02, -0.01))
            };
            (0..20_000).map(sample).collect()
        });
        let mixed = tone.mix([&both[0], &both[1]], &[]).unwrap();
        assert!((mixed.value - ratio).norm() < 2e-3 * ratio.norm());
        assert!((mixed.reference / 0.5 - 0.935).abs() < 5e-3, "{mixed:?}");
        assert!(mixed.unsteady < 5e-3, "{}", mixed.unsteady);
    }

    /// The samples marked as lost hold wrong values instead of zeros, so that using them would show.
    #[test]
    fn blocks_with_lost_samples_are_skipped() {
        let tone = Tone::new(8, 1e6);
        let echo: Vec<Sample> = (0..1024)
            .map(|i| counts(phasor(f64::from(i) / 8.0) * 0.25))
            .collect();
        let mut wrong = echo.clone();
        wrong[100..130].fill(Sample::new(30000, 30000));
        let gap = 100..130;
        let mixed = tone
            .mix([&echo, &wrong], std::slice::from_ref(&gap))
            .unwrap();
        assert!((mixed.value - 1.0).norm() < 1e-12, "{}", mixed.value);
        // Of 16 blocks of 64 samples, those starting at 64 and at 128 contain lost samples.
        assert_eq!(mixed.whole, 14.0 / 16.0);
        assert_eq!(
            tone.mix([&echo, &echo], std::slice::from_ref(&(0..1024))),
            None
        );
        assert_eq!(tone.mix([&wrong[..0], &wrong[..0]], &[]), None);
    }

    /// A phase that decays as `a exp(-t / T)` deviates from a line by a large part of `a`; a settled phase does not.
    #[test]
    fn settling_tone_is_unsteady_until_settled() {
        let tone = Tone::new(8, 1e6);
        let with = |after: f64| {
            let settling = |i: u32| 0.6 * libm::exp(-(f64::from(i) + after) / 300.0);
            let sample = |i: u32| counts(phasor(f64::from(i) / 8.0 + settling(i) / TAU) * 0.5);
            let burst: Vec<Sample> = (0..1024).map(sample).collect();
            tone.mix([&burst, &burst], &[]).unwrap().unsteady
        };
        assert!(with(0.0) > 0.1, "{}", with(0.0));
        assert!(with(3000.0) < 1e-3, "{}", with(3000.0));
    }
}
