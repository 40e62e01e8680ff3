//! Bias of I and Q, and their imbalance of gain and phase, from the samples of a scene.
//!
//! With a bias `c` and gain and phase errors, a receiver records `z = a s + b conj(s) + c` of the signal `s`.
//!
//! - **Bias.** `c` is constant over the samples of a pulse and over the pulses. The mean of all samples is the bias if
//!   it exceeds 6 standard errors, which follow from the means of 16 blocks of pulses, if the mean pulse has 10 times
//!   the amplitude at frequency 0 that it has at the frequencies 2 to 8 on both sides, and if it is at least 1 % of the
//!   standard deviation.
//! - **Imbalance.** Echoes rotate from pulse to pulse, so that `E[s^2] = 0`, and
//!   `rho = E[z^2] / E[|z|^2] = 2 a b / (|a|^2 + |b|^2)`. The mean pulse is subtracted first. Few echoes, or echoes that
//!   rotate by few turns, have a `rho` of their own, which differs between parts of the recording, while that of the
//!   receiver is constant. Both are separated by standard errors from 16 blocks of pulses and from 16 blocks of samples
//!   of equal power: `rho` counts if it is at least 0.02 and exceeds 5 of both. For Gaussian samples this has a
//!   probability below 1e-6 without imbalance (`F` distribution with 2 and 30 degrees of freedom).
//!
//! `rho = (E[I^2] - E[Q^2] + 2 j E[I Q]) / (E[I^2] + E[Q^2])`. With I as reference, `Q = g (Q_s cos e + I_s sin e)`:
//! `g^2 = E[Q^2] / E[I^2]` and `sin e = E[I Q] / sqrt(E[I^2] E[Q^2])` (Gram-Schmidt orthogonalisation).

use std::f64::consts::TAU;

use super::absent::is_absent;
use num_complex::{Complex32, Complex64};
#[cfg(feature = "recording")]
use subaperture_signal::phase::narrow;
use subaperture_signal::phase::{phasor, widen};

/// Number of blocks of pulses, and of samples.
const BLOCKS: usize = 16;

/// Standard errors that a bias, or an imbalance, exceeds.
const BIAS_ERRORS: f64 = 6.0;
const IMBALANCE_ERRORS: f64 = 5.0;

/// Minimum bias relative to the standard deviation, and minimum `rho`.
const LEAST_BIAS: f64 = 0.01;
const LEAST_RHO: f64 = 0.02;

/// Ratio of the amplitude at frequency 0 to that nearby, from which the mean pulse has a bias.
const LINE: f64 = 10.0;

/// Largest gain error as a factor that is corrected.
#[cfg(feature = "recording")]
const MAX_GAIN: f64 = 10.0;

/// Largest phase error that is corrected, as a sine.
#[cfg(feature = "recording")]
const MAX_SINE: f64 = 0.9;

/// First moments of the samples, and powers.
pub(super) struct Moments {
    count: usize,
    sums: Vec<Complex64>,
    powers: Vec<f64>,
    /// Number of pulses in which each sample is recorded.
    recorded: Vec<u32>,
    squares: [f64; 2],
    /// Sum and number of the samples of each block of pulses.
    blocks: [(Complex64, usize); BLOCKS],
    /// Number of pulses with recorded samples.
    num_pulses: usize,
}

impl Moments {
    pub(super) fn new(count: usize, num_samples: usize) -> Self {
        Self {
            count,
            sums: vec![Complex64::ZERO; num_samples],
            powers: vec![0.0; num_samples],
            recorded: vec![0; num_samples],
            squares: [0.0; 2],
            blocks: [(Complex64::ZERO, 0); BLOCKS],
            num_pulses: 0,
        }
    }

    pub(super) fn num_pulses(&self) -> usize {
        self.num_pulses
    }

    /// Add pulse `i` of `count`.
    pub(super) fn add(&mut self, i: usize, row: &[Complex32]) {
        let (mut total, mut count) = (Complex64::ZERO, 0);
        for (k, z) in row.iter().enumerate() {
            if is_absent(*z) {
                continue;
            }
            let z = widen(*z);
            self.sums[k] += z;
            self.powers[k] += z.norm_sqr();
            self.recorded[k] += 1;
            self.squares[0] += z.re * z.re;
            self.squares[1] += z.im * z.im;
            total += z;
            count += 1;
        }
        let block = &mut self.blocks[i * BLOCKS / self.count];
        block.0 += total;
        block.1 += count;
        self.num_pulses += usize::from(count > 0);
    }

    fn num_values(&self) -> f64 {
        self.blocks.iter().map(|(_, count)| *count).sum::<usize>() as f64
    }

    /// Mean of each sample over the pulses; `missing` where no pulse has it.
    fn mean_pulse(&self, missing: Complex64) -> impl Iterator<Item = Complex64> {
        let each = self.sums.iter().zip(&self.recorded);
        each.map(move |(sum, &count)| match count {
            0 => missing,
            _ => sum / f64::from(count),
        })
    }

    /// Mean of all samples.
    fn mean(&self) -> Complex64 {
        self.sums.iter().sum::<Complex64>() / self.num_values()
    }

    /// Standard deviations of I and Q about the mean.
    fn deviations(&self) -> [f64; 2] {
        let mean = self.mean();
        [(self.squares[0], mean.re), (self.squares[1], mean.im)]
            .map(|(squares, mean)| (squares / self.num_values() - mean * mean).max(0.0).sqrt())
    }

    /// Standard error of the mean by the blocks of pulses.
    fn mean_error(&self) -> f64 {
        let mean = self.mean();
        let means = (self.blocks.iter())
            .filter(|(_, count)| *count > 0)
            .map(|(sum, count)| sum / *count as f64);
        let (mut spread, mut count) = (0.0, 0);
        for block in means {
            spread += (block - mean).norm_sqr();
            count += 1;
        }
        match count {
            0 | 1 => f64::INFINITY,
            _ => (spread / f64::from(count * (count - 1))).sqrt(),
        }
    }

    /// Whether the mean pulse has a line at frequency 0.
    fn has_line(&self) -> bool {
        let pulse: Vec<Complex64> = self.mean_pulse(self.mean()).collect();
        let num_samples = pulse.len();
        let near = 2..=8usize;
        if num_samples < 2 * near.end() + 2 {
            return false;
        }
        let component = |bin: f64| {
            let turn = bin / num_samples as f64;
            let terms = pulse.iter().enumerate();
            let sum: Complex64 = terms.map(|(k, z)| z * phasor(-turn * k as f64)).sum();
            sum.norm_sqr()
        };
        let around: f64 = near
            .clone()
            .map(|bin| component(bin as f64) + component(-(bin as f64)))
            .sum();
        component(0.0) >= LINE * LINE * around / (2 * near.count()) as f64
    }

    fn bias(&self) -> Option<Complex64> {
        let mean = self.mean();
        let deviation = self.deviations().iter().map(|s| s * s).sum::<f64>().sqrt();
        let is_large = mean.norm() >= LEAST_BIAS * deviation && mean.norm() > 0.0;
        (is_large && mean.norm() >= BIAS_ERRORS * self.mean_error() && self.has_line())
            .then_some(mean)
    }
}

/// Sums of `z^2` and `|z|^2` over a block.
#[derive(Clone, Copy, Default)]
struct Block {
    square: Complex64,
    power: f64,
}

impl Block {
    fn add(&mut self, z: Complex64) {
        self.square += z * z;
        self.power += z.norm_sqr();
    }
}

/// Second moments of the samples without the mean pulse.
pub(super) struct Residuals {
    moments: Moments,
    mean_pulse: Vec<Complex64>,
    /// Block of each sample of a pulse; blocks have equal powers.
    block_of: Vec<u8>,
    by_pulse: [Block; BLOCKS],
    by_sample: [Block; BLOCKS],
}

impl Residuals {
    pub(super) fn new(moments: Moments) -> Self {
        let mean_pulse: Vec<Complex64> = moments.mean_pulse(Complex64::ZERO).collect();
        let powers = || {
            let each = moments
                .powers
                .iter()
                .zip(&mean_pulse)
                .zip(&moments.recorded);
            each.map(|((power, mean), &count)| {
                (power - f64::from(count) * mean.norm_sqr()).max(0.0)
            })
        };
        let total: f64 = powers().sum();
        let mut before = 0.0;
        let block_of = powers()
            .map(|power| {
                let middle = (before + 0.5 * power) / total;
                before += power;
                ((middle * BLOCKS as f64) as usize).min(BLOCKS - 1) as u8
            })
            .collect();
        Self {
            moments,
            mean_pulse,
            block_of,
            by_pulse: [Block::default(); BLOCKS],
            by_sample: [Block::default(); BLOCKS],
        }
    }

    /// Add pulse `i` of the examined ones.
    pub(super) fn add(&mut self, i: usize, row: &[Complex32]) {
        let count = self.moments.count;
        let mut pulse = Block::default();
        for ((z, mean), block) in row.iter().zip(&self.mean_pulse).zip(&self.block_of) {
            if is_absent(*z) {
                continue;
            }
            let z = widen(*z) - mean;
            pulse.add(z);
            self.by_sample[usize::from(*block)].add(z);
        }
        let sum = &mut self.by_pulse[i * BLOCKS / count];
        sum.square += pulse.square;
        sum.power += pulse.power;
    }

    /// Significant bias and imbalance; no imbalance of real samples, which were not added.
    pub(super) fn balance(&self) -> Balance {
        let deviations = self.moments.deviations();
        let rho = rho(&self.by_pulse);
        let exceeds = |blocks: &[Block]| {
            error(blocks).is_some_and(|error| rho.norm() >= IMBALANCE_ERRORS * error)
        };
        let counts = rho.norm() >= LEAST_RHO && exceeds(&self.by_pulse) && exceeds(&self.by_sample);
        Balance {
            bias: self.moments.bias(),
            deviations,
            imbalance: counts.then(|| Imbalance::of(rho)),
        }
    }
}

/// Ratio of the sums of `z^2` and `|z|^2`.
fn rho(blocks: &[Block]) -> Complex64 {
    let square: Complex64 = blocks.iter().map(|block| block.square).sum();
    let power: f64 = blocks.iter().map(|block| block.power).sum();
    match power > 0.0 {
        true => square / power,
        false => Complex64::ZERO,
    }
}

/// Standard error of the ratio by its differences between blocks; `None` if fewer than 4 blocks share the power.
fn error(blocks: &[Block]) -> Option<f64> {
    let rho = rho(blocks);
    let total: f64 = blocks.iter().map(|block| block.power).sum();
    let squares: f64 = blocks.iter().map(|block| block.power * block.power).sum();
    let effective = total * total / squares;
    let spread: f64 = blocks
        .iter()
        .map(|block| (block.square - rho * block.power).norm_sqr())
        .sum();
    (effective >= 4.0).then(|| (spread * effective / (effective - 1.0)).sqrt() / total)
}

/// Bias and imbalance of I and Q, each if significant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Balance {
    /// Mean of I and of Q.
    pub(crate) bias: Option<Complex64>,
    /// Standard deviations of I and Q.
    pub(crate) deviations: [f64; 2],
    pub(crate) imbalance: Option<Imbalance>,
}

/// Imbalance of I and Q; I is the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Imbalance {
    /// Gain of Q relative to I.
    pub(crate) gain: f64,
    /// Sine of the phase error.
    pub(crate) sine: f64,
    /// Amplitude of the image at mirrored frequencies relative to the echo.
    pub(crate) image: f64,
}

impl Imbalance {
    fn of(rho: Complex64) -> Self {
        let (real, imaginary) = (rho.re.clamp(-1.0, 1.0), rho.im);
        let norm = rho.norm().min(1.0);
        Self {
            gain: ((1.0 - real) / (1.0 + real)).sqrt(),
            sine: (imaginary / (1.0 - real * real).sqrt()).clamp(-1.0, 1.0),
            image: norm / (1.0 + (1.0 - norm * norm).sqrt()),
        }
    }

    /// Phase error of Q relative to I, degrees.
    pub(crate) fn phase_deg(&self) -> f64 {
        libm::asin(self.sine) * 360.0 / TAU
    }
}

/// Correction of bias and imbalance.
#[cfg(feature = "recording")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correction {
    bias: Complex64,
    gain: f64,
    sine: f64,
}

#[cfg(feature = "recording")]
impl Correction {
    /// Correction of a balance; `None` if there is no defect.
    ///
    /// # Errors
    /// A message, if I and Q are too similar or too different to be corrected.
    pub(crate) fn of(balance: &Balance) -> Result<Option<Self>, String> {
        if balance.bias.is_none() && balance.imbalance.is_none() {
            return Ok(None);
        }
        let (gain, sine) = balance.imbalance.map_or((1.0, 0.0), |i| (i.gain, i.sine));
        let is_usual = (1.0 / MAX_GAIN..=MAX_GAIN).contains(&gain) && sine.abs() <= MAX_SINE;
        if !is_usual {
            return Err(format!(
                "gain of Q relative to I {gain:.3}, sine of the phase error {sine:.3}: beyond a correction (gain 0.1 to 10, sine up to {MAX_SINE}). Check the \
                 order of I and Q in the file"
            ));
        }
        Ok(Some(Self {
            bias: balance.bias.unwrap_or_default(),
            gain,
            sine,
        }))
    }

    /// The signal of a recorded sample.
    pub(crate) fn apply(&self, z: Complex32) -> Complex32 {
        let z = widen(z) - self.bias;
        let im = (z.im / self.gain - z.re * self.sine) / (1.0 - self.sine * self.sine).sqrt();
        narrow(Complex64::new(z.re, im))
    }
}
