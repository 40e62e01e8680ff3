//! A pulse's targets: path and phases of each from all samples, with their standard deviations.
//!
//! Each target is looked at with the others taken away: in turn, its echo is added to what all have left of the samples, its path is moved
//! to the top of `sum_c |S_c(p)|^2` by Newton's steps on the exact sum, and its amplitudes are taken as `S_c(p) / sum w`. What is left in the end is
//! noise, and clutter that is no point; its power in the training cells of a target is the target's noise.
//!
//! **Standard deviations.** With noise of power `s^2` a sample, amplitude `a` and `kappa_k = 2 pi (k - (K-1)/2) step / c`, to first order
//!
//! ```text
//! SNR = |a|^2 (sum w)^2 / (s^2 sum w^2),        var(phase) = 1 / (2 SNR)
//! var(path) = s^2 sum w^2 kappa^2 / (2 |a|^2 (sum w kappa^2)^2)
//! ```
//!
//! The top moves by the noise's slope over the curvature of the peak: `Re` of the derivative of the noise has the variance
//! `s^2 sum w^2 kappa^2 / 2`, the peak's curvature is `|a| sum w kappa^2`. Without a window that is the bound of Cramer and Rao; windows lose, by
//! a quarter or so. As `w` is even and `kappa` odd about the middle, phase and path have uncorrelated errors. `tests/echoes.rs` compares with what noise does.
//!
//! The range told is half of the mean path of the channels, each at the top of its own peak.

use num_complex::Complex64;

use crate::cfar::{Detector, Peak};
use crate::profile::{Echoes, Profiler};

/// Rounds over all targets: each brings what leaks of one into another down by as much as leaks.
const ROUNDS: usize = 3;
/// Newton's steps a round; the first is within a sixteenth of the peak's width.
const STEPS: usize = 2;
/// What is stronger than noise by more is taken for this strong: samples are float32, and no radar's receiver is better.
const MOST_SNR: f64 = 1e9;

/// A target in a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Echo {
    /// Half of the mean path of all channels, metres, and its standard deviation.
    pub range_m: f64,
    /// Metres.
    pub range_sigma_m: f64,
    /// Of each channel, radians: `-2 pi f_m path / c` and what reflection adds.
    pub phases_rad: Vec<f64>,
    /// Of each of them, radians, RMS over the channels.
    pub phase_sigma_rad: f64,
    /// Power over that of noise in its range cell, of each channel.
    pub snr: Vec<f64>,
}

/// A target while it is found.
struct Found {
    path_m: f64,
    amplitudes: Vec<Complex64>,
}

/// `S`, `dS/dp` and `d^2S/dp^2`.
type Slopes = [Complex64; 3];

/// The targets at these peaks.
pub(crate) fn echoes(
    profiler: &Profiler,
    detector: &Detector,
    samples: &Echoes,
    peaks: &[Peak],
) -> Vec<Echo> {
    let mut left = samples.clone();
    let mut found: Vec<Found> = peaks
        .iter()
        .map(|peak| Found {
            path_m: profiler.path_m(peak.bin),
            amplitudes: vec![Complex64::ZERO; samples.len()],
        })
        .collect();
    let total: f64 = profiler.window.iter().sum();
    for _ in 0..ROUNDS {
        for target in &mut found {
            add(profiler, &mut left, target, 1.0);
            for _ in 0..STEPS {
                target.path_m += step_m(profiler, &slopes(profiler, &left, target.path_m));
            }
            let tops = slopes(profiler, &left, target.path_m);
            target.amplitudes = tops.iter().map(|[value, ..]| value / total).collect();
            add(profiler, &mut left, target, -1.0);
        }
    }
    let noise: Vec<Vec<f64>> = left.iter().map(|left| profiler.power(left)).collect();
    let each = found.into_iter().zip(peaks);
    each.map(|(target, peak)| {
        add(profiler, &mut left, &target, 1.0);
        let tops = slopes(profiler, &left, target.path_m);
        add(profiler, &mut left, &target, -1.0);
        let noise = noise
            .iter()
            .map(|power| mean_noise(detector, power, peak.bin));
        measured(profiler, target.path_m, &tops, noise)
    })
    .collect()
}

/// Adds a target's echo times `sign`.
fn add(profiler: &Profiler, left: &mut Echoes, target: &Found, sign: f64) {
    if target.amplitudes.iter().all(|a| *a == Complex64::ZERO) {
        return;
    }
    let phasors: Vec<Complex64> = profiler.phasors(-target.path_m).collect();
    for (left, amplitude) in left.iter_mut().zip(&target.amplitudes) {
        let own = sign * amplitude;
        for (z, phasor) in left.iter_mut().zip(&phasors) {
            *z += own * phasor;
        }
    }
}

/// Of each channel.
fn slopes(profiler: &Profiler, samples: &Echoes, path_m: f64) -> Vec<Slopes> {
    let weighted: Vec<(Complex64, f64)> = profiler
        .phasors(path_m)
        .zip(&profiler.window)
        .enumerate()
        .map(|(k, (phasor, w))| (phasor * w, profiler.rad_m(k)))
        .collect();
    let sums = |samples: &Vec<Complex64>| {
        let mut sums = [Complex64::ZERO; 3];
        for (z, (weight, rad_m)) in samples.iter().zip(&weighted) {
            let value = z * weight;
            sums[0] += value;
            sums[1] += Complex64::new(-value.im, value.re) * *rad_m;
            sums[2] -= value * (rad_m * rad_m);
        }
        sums
    };
    samples.iter().map(sums).collect()
}

/// Slope and curvature of `|S|^2 / 2`.
fn bend(&[value, first, second]: &Slopes) -> [f64; 2] {
    [
        (value.conj() * first).re,
        first.norm_sqr() + (value.conj() * second).re,
    ]
}

/// Newton's step to the top of the power of all channels, a bin at the most.
fn step_m(profiler: &Profiler, slopes: &[Slopes]) -> f64 {
    let [slope, curvature] = slopes
        .iter()
        .map(bend)
        .fold([0.0, 0.0], |[a, b], [c, d]| [a + c, b + d]);
    limited(slope, curvature, profiler.bin_m())
}

/// Towards the top, no farther than `most`.
fn limited(slope: f64, curvature: f64, most: f64) -> f64 {
    match curvature < 0.0 {
        true => (-slope / curvature).clamp(-most, most),
        false if slope == 0.0 => 0.0,
        false => most.copysign(slope),
    }
}

/// Mean power in a bin's training cells.
fn mean_noise(detector: &Detector, power: &[f64], bin: usize) -> f64 {
    let [before, after] = detector.training(power, bin);
    let (sum, count) = before
        .chain(after)
        .fold((0.0, 0usize), |(sum, count), p| (sum + p, count + 1));
    sum / count.max(1) as f64
}

fn measured(
    profiler: &Profiler,
    path_m: f64,
    tops: &[Slopes],
    noise: impl Iterator<Item = f64>,
) -> Echo {
    let window = &profiler.window;
    let (mut sum, mut squares) = (0.0, 0.0);
    let (mut curved, mut spread) = (0.0, 0.0);
    for (k, w) in window.iter().enumerate() {
        let rad_m2 = profiler.rad_m(k).powi(2);
        sum += w;
        squares += w * w;
        curved += w * rad_m2;
        spread += w * w * rad_m2;
    }
    // Variance of a path times the SNR.
    let path_m2 = spread * sum * sum / (2.0 * curved * curved * squares);
    let snr: Vec<f64> = tops
        .iter()
        .zip(noise)
        .map(|([value, ..], noise)| {
            let power = value.norm_sqr();
            match noise * MOST_SNR > power {
                true => power / noise,
                false => MOST_SNR,
            }
        })
        .collect();
    let count = tops.len() as f64;
    let off_m = |slopes: &Slopes| {
        let [slope, curvature] = bend(slopes);
        limited(slope, curvature, 0.5 * profiler.cell_m())
    };
    let mean_path_m = path_m + tops.iter().map(off_m).sum::<f64>() / count;
    let inverse: f64 = snr.iter().map(|snr| 1.0 / snr).sum();
    Echo {
        range_m: 0.5 * profiler.told_m(mean_path_m),
        range_sigma_m: 0.5 * (path_m2 * inverse).sqrt() / count,
        phases_rad: tops
            .iter()
            .map(|[value, ..]| libm::atan2(value.im, value.re))
            .collect(),
        phase_sigma_rad: (0.5 * inverse / count).sqrt(),
        snr,
    }
}
