//! A burst at a carrier: what two channels make of the tone.

use num_complex::{Complex, Complex32};

use crate::Turns;

/// Blocks that a burst is cut into, if it has periods enough; not twice as many.
const BLOCKS: usize = 16;
const MOST_BLOCKS: usize = 2 * BLOCKS - 1;

/// What is left of a burst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mixed {
    /// Echo over reference.
    pub(super) value: Complex32,
    /// Part of the blocks that came whole.
    pub(super) whole: f32,
    /// How far the reference's blocks are from a tone of one amplitude and one frequency: the larger of a part of the amplitude and radians.
    pub(super) unsteady: f32,
}

/// Folds a burst, block by block.
#[derive(Clone, Debug)]
pub(super) struct Mixer<const PERIOD: usize> {
    period: usize,
    /// Samples a block, and samples of all blocks.
    block: u32,
    used: u32,
    /// `exp(-j 2 pi i / P)`.
    turns: [Complex32; PERIOD],
    /// Counts added up by their place in the period: reference and echo. [`super::Setup`] allows no more of them than an `i32` holds.
    sums: [[Complex<i32>; 2]; PERIOD],
    /// The block in hand, and how many of its samples came.
    at: u32,
    came: u32,
    /// Blocks that came whole: where, and their reference.
    references: [(u32, Complex32); MOST_BLOCKS],
    count: usize,
    cross: Complex32,
    power: f32,
}

impl<const PERIOD: usize> Mixer<PERIOD> {
    /// Empty buffers.
    pub(super) const fn new() -> Self {
        Self {
            period: 0,
            block: 0,
            used: 0,
            turns: [Complex32::ZERO; PERIOD],
            sums: [[Complex::new(0, 0); 2]; PERIOD],
            at: 0,
            came: 0,
            references: [(0, Complex32::ZERO); MOST_BLOCKS],
            count: 0,
            cross: Complex32::ZERO,
            power: 0.0,
        }
    }

    /// For tones of `period` samples, in bursts of `samples`, which are more.
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

    /// The next burst.
    pub(super) fn begin(&mut self) {
        self.clear();
        self.at = 0;
        self.count = 0;
        self.cross = Complex32::ZERO;
        self.power = 0.0;
    }

    fn clear(&mut self) {
        self.came = 0;
        self.sums = [[Complex::new(0, 0); 2]; PERIOD];
    }

    /// Takes samples from number `first` of the burst on, reference and echo; they are not behind those before. What lies between is lost.
    pub(super) fn push(&mut self, first: u32, samples: impl Iterator<Item = [Complex<i16>; 2]>) {
        let block = self.block.max(1);
        let mut place = first as usize % self.period.max(1);
        for (number, pair) in (first..self.used).zip(samples) {
            let at = number / block;
            if at != self.at {
                self.clear();
                self.at = at;
            }
            if let Some(sums) = self.sums.get_mut(place) {
                for (sum, sample) in sums.iter_mut().zip(pair) {
                    // As wide as the sums of the longest block are.
                    sum.re = sum.re.wrapping_add(sample.re.into());
                    sum.im = sum.im.wrapping_add(sample.im.into());
                }
            }
            place += 1;
            if place == self.period {
                place = 0;
            }
            self.came += 1;
            if self.came == block {
                self.close();
            }
        }
    }

    /// The block in hand is whole.
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
            *place = (self.at, reference);
            self.count += 1;
        }
        self.clear();
        self.at += 1;
    }

    /// What has come of the burst; none if no block came whole or the reference is nothing.
    pub(super) fn mixed(&self) -> Option<Mixed> {
        if self.power.is_nan() || self.power <= 0.0 {
            return None;
        }
        let references = self.references.get(..self.count)?;
        let blocks = self.used / self.block.max(1);
        Some(Mixed {
            value: self.cross / self.power,
            whole: self.count as f32 / blocks as f32,
            unsteady: unsteadiness(references),
        })
    }
}

/// How far blocks are from a tone of one amplitude and one frequency.
fn unsteadiness(blocks: &[(u32, Complex32)]) -> f32 {
    let n = blocks.len() as f32;
    let amplitude = |x: &Complex32| libm::sqrtf(x.norm_sqr());
    let mean = blocks.iter().map(|(_, x)| amplitude(x)).sum::<f32>() / n;
    let mut most = 0.0f32;
    for (_, x) in blocks {
        most = most.max(libm::fabsf(amplitude(x) / mean - 1.0));
    }
    // Phases from block to block, never more than half a turn apart: tones turn much faster than synthesisers are off.
    let mut phases = [(0.0, 0.0); MOST_BLOCKS];
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
