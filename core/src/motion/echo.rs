//! Range and phases of each target of a pulse, from all samples.
//!
//! Targets are looked at with the others taken away: in turn, and three times over, a target's echo is added to what all have left of the samples, its range is moved
//! to the top of `sum_c |S_c(u)|^2` by Newton's steps on the sum itself ([`super::profile`]), its amplitudes are `S_c(u)`, and it is taken away again. As the window is symmetric about
//! the middle of the band, the phase of `S_c` is that of the path at the frequency there, whatever the error of `u`.
//!
//! With noise of power `s^2` a sample, which is what is left of all samples in the end, to first order
//!
//! ```text
//! SNR = |a|^2 / (s^2 sum w^2),   var(phase) = 1 / (2 SNR),   var(u) = sum w^2 x^2 / (2 SNR sum w^2 (sum w x^2)^2)        sum w = 1
//! ```
//!
//! Clutter that is no point, and targets for which there was no room, count as noise of all ranges.

use core::f64::consts::PI;

use num_complex::Complex32;

use super::setup::Axis;
use crate::Turns;

/// Rounds over all targets: each brings what leaks of one into another down by as much as leaks.
pub(super) const ROUNDS: u8 = 3;
/// Newton's steps a round; the first is within half a bin of the peak.
const STEPS: usize = 2;
/// Frequencies from one phasor that is computed to the next; those between are rotated.
const ANCHOR: usize = 16;
/// What is stronger than noise by more is taken for this strong: samples are float32, and no radar's receiver is better.
const MOST_SNR: f32 = 1e9;

/// A target while it is found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found<const CHANNELS: usize> {
    /// Where its peak is.
    pub(super) peak_cells: f64,
    cells: f64,
    amplitudes: [Complex32; CHANNELS],
}

/// A target that was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<const CHANNELS: usize> {
    /// Half of the mean path of all channels, and its standard deviation.
    pub(super) cells: f64,
    pub(super) sigma_cells: f64,
    /// Of each channel, radians.
    pub(super) phases_rad: [f64; CHANNELS],
    pub(super) phase_sigma_rad: f64,
    /// Of the weakest channel.
    pub(super) least_snr: f32,
}

/// Sums over the window.
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

impl<const CHANNELS: usize> Found<CHANNELS> {
    /// At a peak, with nothing known of it yet.
    pub(super) const fn at(peak_cells: f64) -> Self {
        Self {
            peak_cells,
            cells: peak_cells,
            amplitudes: [Complex32::ZERO; CHANNELS],
        }
    }
}

impl<const CHANNELS: usize> Seen<CHANNELS> {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        cells: 0.0,
        sigma_cells: 0.0,
        phases_rad: [0.0; CHANNELS],
        phase_sigma_rad: 0.0,
        least_snr: 0.0,
    };

    /// As seen a whole profile nearer or farther: of an even number of frequencies, whose middle is between two, the phase there is another by half a turn.
    pub(super) fn turn_round(&mut self, frequencies: usize) {
        if frequencies.is_multiple_of(2) {
            for phase in &mut self.phases_rad {
                *phase -= libm::copysign(PI, *phase);
            }
        }
    }
}

impl Moments {
    /// What fills empty storage.
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

/// `x_k` of all samples in turn.
fn abscissae(frequencies: usize) -> impl Iterator<Item = f32> {
    let unit = core::f32::consts::PI / frequencies as f32;
    let last = frequencies as i32 - 1;
    (0..).map(move |k: i32| (2 * k - last) as f32 * unit)
}

/// `exp(+j x_k u)` of all samples in turn, into `phasors`.
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

/// Samples of the channels that there are, `F` each, and what they are looked at with.
pub(super) struct Look<'a, const FREQUENCIES: usize> {
    pub(super) axis: &'a Axis,
    pub(super) samples: &'a mut [[Complex32; FREQUENCIES]],
    pub(super) weights: &'a [f32],
    /// As many as there are weights: scratch.
    pub(super) phasors: &'a mut [Complex32],
}

impl<const FREQUENCIES: usize> Look<'_, FREQUENCIES> {
    /// A target's turn of a round.
    pub(super) fn refine<const CHANNELS: usize>(&mut self, target: &mut Found<CHANNELS>) {
        fill(self.phasors, target.cells);
        self.add(target, 1.0);
        for _ in 0..STEPS {
            let mut bends = [0.0; 2];
            for samples in self.samples.iter() {
                let [slope, curvature] = bend(&self.slopes(samples));
                bends = [bends[0] + slope, bends[1] + curvature];
            }
            let most = self.axis.cells_a_bin as f32;
            target.cells += f64::from(limited(bends[0], bends[1], most));
            fill(self.phasors, target.cells);
        }
        for (amplitude, samples) in target.amplitudes.iter_mut().zip(self.samples.iter()) {
            *amplitude = self.slopes(samples)[0];
        }
        self.add(target, -1.0);
    }

    /// Noise power of a sample in each channel, after so many targets have been taken away.
    pub(super) fn noise<const CHANNELS: usize>(&self, targets: usize) -> [f32; CHANNELS] {
        let mut noise = [0.0; CHANNELS];
        // An amplitude a target is what was fitted.
        let free = self.weights.len().saturating_sub(targets).max(1) as f32;
        for (noise, samples) in noise.iter_mut().zip(self.samples.iter()) {
            let own = samples.iter().take(self.weights.len());
            *noise = own.map(Complex32::norm_sqr).sum::<f32>() / free;
        }
        noise
    }

    /// What is told of a target, with noise of such power a sample.
    pub(super) fn measured<const CHANNELS: usize>(
        &mut self,
        target: &Found<CHANNELS>,
        noise: &[f32; CHANNELS],
        moments: &Moments,
    ) -> Seen<CHANNELS> {
        fill(self.phasors, target.cells);
        let mut seen = Seen::EMPTY;
        seen.least_snr = MOST_SNR;
        let (mut inverse, mut off, mut count) = (0.0f32, 0.0f32, 0.0f32);
        let all = self.samples.iter().zip(&target.amplitudes).zip(noise);
        for (((samples, amplitude), noise), phase) in all.zip(&mut seen.phases_rad) {
            // Its own echo, which is all taken away, and what the others leave.
            let [value, first, second] = self.slopes(samples);
            let top = [
                value + amplitude,
                first,
                second - amplitude * moments.curvature,
            ];
            let [slope, curvature] = bend(&top);
            off += limited(slope, curvature, 0.5);
            let noise = noise * moments.squares;
            let power = top[0].norm_sqr();
            let snr = match noise * MOST_SNR > power {
                true => power / noise,
                false => MOST_SNR,
            };
            seen.least_snr = seen.least_snr.min(snr);
            inverse += 1.0 / snr;
            *phase = libm::atan2f(top[0].im, top[0].re).into();
            count += 1.0;
        }
        // Variance of a range times the SNR.
        let Moments {
            squares,
            curvature,
            spread,
        } = *moments;
        let variance = spread / (2.0 * squares * curvature * curvature);
        seen.cells = target.cells + f64::from(off / count);
        seen.sigma_cells = f64::from(libm::sqrtf(variance * inverse) / count);
        seen.phase_sigma_rad = f64::from(libm::sqrtf(0.5 * inverse / count));
        seen
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

    /// Adds a target's echo times `sign`; `phasors` are at its range.
    fn add<const CHANNELS: usize>(&mut self, target: &Found<CHANNELS>, sign: f32) {
        for (samples, amplitude) in self.samples.iter_mut().zip(&target.amplitudes) {
            let own = amplitude * sign;
            for (z, phasor) in samples.iter_mut().zip(self.phasors.iter()) {
                *z += own * phasor.conj();
            }
        }
    }
}

/// Slope and curvature of `|S|^2 / 2`.
fn bend(&[value, first, second]: &Slopes) -> [f32; 2] {
    [
        (value.conj() * first).re,
        first.norm_sqr() + (value.conj() * second).re,
    ]
}

/// Towards the top, no farther than `most`.
fn limited(slope: f32, curvature: f32, most: f32) -> f32 {
    match curvature < 0.0 {
        true => (-slope / curvature).max(-most).min(most),
        false if slope == 0.0 => 0.0,
        false => libm::copysignf(most, slope),
    }
}
