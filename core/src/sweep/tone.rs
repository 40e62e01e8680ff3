//! Complex ratio of echo and reference from a burst of a tone.

use num_complex::{Complex, Complex32};

use crate::Turns;

/// Number of blocks per burst, if it has enough periods; always less than twice this number.
const BLOCKS: usize = 16;
const MAX_BLOCKS: usize = 2 * BLOCKS - 1;

/// Result of one burst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ratio {
    /// Echo divided by reference.
    pub(super) value: Complex32,
    /// Fraction of complete blocks.
    pub(super) complete: f32,
    /// Deviation of the reference from a tone of constant amplitude and frequency: the larger of the relative amplitude deviation and the phase deviation in radians.
    pub(super) unsteadiness: f32,
}

/// Accumulator of a burst, block by block.
#[derive(Clone, Debug)]
pub(super) struct Mixer<const PERIOD: usize> {
    period: usize,
    /// Samples per block, and samples of all blocks.
    block: u32,
    used: u32,
    /// `exp(-j 2 pi i / P)`.
    turns: [Complex32; PERIOD],
    /// Sums by position in the period, for reference and echo. [`super::Setup`] limits them to the range of `i32`.
    sums: [[Complex<i32>; 2]; PERIOD],
    /// Index of the current block, and number of its samples received.
    current_block: u32,
    received: u32,
    /// Index and reference of the complete blocks.
    references: [(u32, Complex32); MAX_BLOCKS],
    count: usize,
    cross: Complex32,
    power: f32,
}

impl<const PERIOD: usize> Mixer<PERIOD> {
    /// Create an accumulator without configuration.
    pub(super) const fn new() -> Self {
        Self {
            period: 0,
            block: 0,
            used: 0,
            turns: [Complex32::ZERO; PERIOD],
            sums: [[Complex::new(0, 0); 2]; PERIOD],
            current_block: 0,
            received: 0,
            references: [(0, Complex32::ZERO); MAX_BLOCKS],
            count: 0,
            cross: Complex32::ZERO,
            power: 0.0,
        }
    }

    /// Configure for tones of `period` samples in bursts of `samples`, at least one period.
    pub(super) fn configure(&mut self, period: u16, samples: u32) {
        let length = u32::from(period).max(1);
        let periods = samples / length;
        self.period = period.into();
        self.block = (periods / BLOCKS as u32).max(1) * length;
        self.used = samples / self.block * self.block;
        let step = Turns::from_f64(-1.0 / f64::from(length));
        for (i, turn) in (0..).zip(&mut self.turns) {
            *turn = step.times(i).phasor();
        }
    }

    /// Start the next burst.
    pub(super) fn begin(&mut self) {
        self.clear();
        self.current_block = 0;
        self.count = 0;
        self.cross = Complex32::ZERO;
        self.power = 0.0;
    }

    fn clear(&mut self) {
        self.received = 0;
        self.sums = [[Complex::new(0, 0); 2]; PERIOD];
    }

    /// Add samples from index `first` of the burst on, reference and echo. `first` must not be behind the previous ones; samples in between are missing.
    pub(super) fn push(&mut self, first: u32, samples: impl Iterator<Item = [Complex<i16>; 2]>) {
        let block = self.block.max(1);
        let mut place = first as usize % self.period.max(1);
        for (number, pair) in (first..self.used).zip(samples) {
            let current_block = number / block;
            if current_block != self.current_block {
                self.clear();
                self.current_block = current_block;
            }
            if let Some(sums) = self.sums.get_mut(place) {
                for (sum, sample) in sums.iter_mut().zip(pair) {
                    // As wide as the sums of the longest block.
                    sum.re = sum.re.wrapping_add(sample.re.into());
                    sum.im = sum.im.wrapping_add(sample.im.into());
                }
            }
            place += 1;
            if place == self.period {
                place = 0;
            }
            self.received += 1;
            if self.received == block {
                self.close();
            }
        }
    }

    /// Finish the current block, which is complete.
    fn close(&mut self) {
        let mut means = [Complex32::ZERO; 2];
        for (sums, turn) in self.sums.iter().zip(&self.turns).take(self.period) {
            for (mean, sum) in means.iter_mut().zip(sums) {
                *mean += turn * Complex32::new(sum.re as f32, sum.im as f32);
            }
        }
        let unit = 1.0 / (self.block as f32 * 32768.0);
        let [reference, echo] = means.map(|mean| mean * unit);
        self.cross += echo * reference.conj();
        self.power += reference.norm_sqr();
        if let Some(place) = self.references.get_mut(self.count) {
            *place = (self.current_block, reference);
            self.count += 1;
        }
        self.clear();
        self.current_block += 1;
    }

    /// Result of the burst. `None` without a complete block or if the reference is zero.
    pub(super) fn mixed(&self) -> Option<Ratio> {
        if self.power.is_nan() || self.power <= 0.0 {
            return None;
        }
        let references = self.references.get(..self.count)?;
        let blocks = self.used / self.block.max(1);
        Some(Ratio {
            value: self.cross / self.power,
            complete: self.count as f32 / blocks as f32,
            unsteadiness: unsteadiness(references),
        })
    }
}

/// Deviation of the blocks from a tone of constant amplitude and frequency.
fn unsteadiness(blocks: &[(u32, Complex32)]) -> f32 {
    let n = blocks.len() as f32;
    let amplitude = |x: &Complex32| libm::sqrtf(x.norm_sqr());
    let mean = blocks.iter().map(|(_, x)| amplitude(x)).sum::<f32>() / n;
    let mut most = 0.0f32;
    for (_, x) in blocks {
        most = most.max(libm::fabsf(amplitude(x) / mean - 1.0));
    }
    // Phases from block to block differ by at most half a turn: synthesiser offsets are small compared to the tone frequency.
    let mut phases = [(0.0, 0.0); MAX_BLOCKS];
    let mut before = blocks.first().map_or(Complex32::ONE, |(_, x)| *x);
    let mut phase = 0.0;
    let (mut middle, mut level) = (0.0, 0.0);
    for (place, (block, x)) in phases.iter_mut().zip(blocks) {
        let turn = x * before.conj();
        phase += libm::atan2f(turn.im, turn.re);
        before = *x;
        *place = (*block as f32, phase);
        middle += *block as f32 / n;
        level += phase / n;
    }
    let phases = phases.get(..blocks.len()).unwrap_or(&[]);
    let (mut spread, mut product) = (0.0, 0.0);
    for (block, phase) in phases {
        spread += (block - middle) * (block - middle);
        product += (block - middle) * (phase - level);
    }
    let slope = if spread > 0.0 { product / spread } else { 0.0 };
    for (block, phase) in phases {
        most = most.max(libm::fabsf(phase - level - slope * (block - middle)));
    }
    most
}
