//! The tone that is sent at every carrier, and what two channels make of it: C (5.4) to (5.11).
//!
//! The tone has a whole number `P` of samples a period. Of channel `c`, block `b` of a whole number of periods is
//!
//! ```text
//! x_c[b] = mean over the block of s_c[i] exp(-j 2 pi i / P)
//! ```
//!
//! in which an offset of DC and the image of an unequal I and Q, at `-f_0`, are zero. Both channels still turn alike by
//! the synthesisers' phases and their difference of frequency; the least-squares quotient does not:
//!
//! ```text
//! z = sum_b x_1[b] conj(x_0[b]) / sum_b |x_0[b]|^2
//! ```
//!
//! A block lasts a quarter of a millisecond at the most ([`LONGEST_BLOCK_S`]), however long the burst: a difference of frequency `d` weakens the mean over `T` seconds by
//! `sinc(d T)` and turns it by `d T` from block to block. Of 1 kHz, more than two synthesisers of a B210 are apart, a tenth of the amplitude and a quarter of a turn: unwrapping
//! phases has as much again to spare. A sixteenth of a dwell of 20 ms would leave nothing of 800 Hz.
//!
//! Neglected: a difference of frequency `d` within a block of `T` seconds weakens both alike (that cancels) and lets DC and image
//! through by a part `d / f_0` (1 kHz of 125 kHz: -42 dB of what there is of them); noise `n` of the
//! reference, relative to it, makes `z` smaller by the part `n / blocks`. Cost: two complex products a sample. Memory: none.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex32, Complex64};
use subaperture_signal::phase::phasor;

use crate::transceiver::Sample;

/// Blocks that a burst is cut into at the least, if it has periods enough.
pub const BLOCKS: usize = 16;
/// Longest block, seconds, if a period is not longer.
pub const LONGEST_BLOCK_S: f64 = 0.25e-3;

/// A tone of a whole number of samples a period.
#[derive(Clone, Debug)]
pub struct Tone {
    turns: Vec<Complex64>,
    /// Periods of the longest block.
    most_periods: usize,
}

/// What is left of a burst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixed {
    /// Echo over reference.
    pub value: Complex64,
    /// Echo by itself, referred to the tone as sent: what there is without a reference.
    pub unreferred: Complex64,
    /// Variance of that by what the blocks scatter, 0 where there is one alone.
    pub variance: f64,
    /// RMS of the reference, of full scale.
    pub reference: f64,
    /// Part of the blocks that came whole.
    pub whole: f64,
    /// How far the reference's blocks are from a tone: the larger of a part of its amplitude and radians of its phase.
    pub unsteady: f64,
}

impl Tone {
    /// A tone of `period` samples, 3 at least (of 2 its image is itself), at `rate_hz` samples a second.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn new(period: usize, rate_hz: f64) -> Self {
        assert!(period >= 3, "a tone of {period} samples a period is none");
        let turns = (0..period)
            .map(|i| phasor(i as f64 / period as f64))
            .collect();
        Self {
            turns,
            // `as` makes nothing of what is no number.
            most_periods: (LONGEST_BLOCK_S * rate_hz / period as f64) as usize,
        }
    }

    /// Samples a period.
    pub fn period(&self) -> usize {
        self.turns.len()
    }

    /// One period to be sent.
    pub fn waveform(&self, amplitude: f64) -> Vec<Complex32> {
        let scale =
            |z: &Complex64| Complex32::new((z.re * amplitude) as f32, (z.im * amplitude) as f32);
        self.turns.iter().map(scale).collect()
    }

    /// Samples a block of a burst of `samples`.
    fn block(&self, samples: usize) -> usize {
        let periods = samples / self.period() / BLOCKS;
        periods.min(self.most_periods).max(1) * self.period()
    }

    /// `x_c` of the block that begins at sample `first`, of full scale.
    fn mean(&self, samples: &[Sample]) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for period in samples.chunks_exact(self.period()) {
            for (s, turn) in period.iter().zip(&self.turns) {
                sum += Complex64::new(f64::from(s.re), f64::from(s.im)) * turn.conj();
            }
        }
        sum / (samples.len() as f64 * 32768.0)
    }

    /// Mixes a burst; `None` if no block came whole or the reference is nothing. `channels` are reference and echo.
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
        // What the quotient leaves of the echo's blocks, `sum |x_1 - z x_0|^2`.
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

/// How far blocks are from a tone of one amplitude and one frequency: the larger of the greatest part by which an amplitude
/// differs from the mean and the greatest phase, radians, by which a block is off the straight line through all. Noise alone makes
/// some `2 / sqrt(SNR)` of it, with the SNR of a block.
fn unsteadiness(blocks: &[(usize, Complex64)]) -> f64 {
    let n = blocks.len() as f64;
    let mean = blocks.iter().map(|(_, x)| x.norm()).sum::<f64>() / n;
    let amplitude = blocks
        .iter()
        .map(|(_, x)| (x.norm() / mean - 1.0).abs())
        .fold(0.0, f64::max);
    // Phases from block to block, never more than half a turn apart a block: the plan's tones turn much faster than offsets.
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

    /// A reference and an echo of it, in DC, with an image, and turning at 900 Hz at 1 MS/s. DC of 0.02 and image of 0.03 come through
    /// by a part of 900 / 125000 each, with some phase: below 5e-4 of 0.5, relative to the echo of 0.1 five times
    /// that. Rounding to counts: 1e-5.
    #[test]
    fn the_quotient_of_channels_knows_no_phase_offset_dc_or_image() {
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

    /// 800 Hz apart over 20 ms: a sixteenth of it is one whole turn, of which the mean is nothing. Blocks of 0.25 ms lose `1 - sinc(0.2)`, 6 %, of both
    /// channels alike; DC and image come through by 800 of 125000, of which 80 blocks at all phases leave less.
    #[test]
    fn a_long_dwell_is_no_worse_than_a_short_one() {
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

    /// What was lost is left out: the samples there are no zeros but wrong ones.
    #[test]
    fn lost_samples_are_left_out_by_blocks() {
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
        // 16 blocks of 64: those from 64 and from 128 are touched.
        assert_eq!(mixed.whole, 14.0 / 16.0);
        assert_eq!(
            tone.mix([&echo, &echo], std::slice::from_ref(&(0..1024))),
            None
        );
        assert_eq!(tone.mix([&wrong[..0], &wrong[..0]], &[]), None);
    }

    /// A phase that decays by `a exp(-t / T)` is off a line by a good part of `a`; one that has settled is not.
    #[test]
    fn a_tone_that_settles_is_unsteady_until_it_has() {
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
