//! Path and phases of each target of a pulse, from all samples, with standard deviations.
//!
//! Each target is estimated with the others subtracted (as in CLEAN). In turn, its echo is added to the residual, Newton steps move its path to the maximum of `sum_c |S_c(p)|^2`, and it is subtracted again with the path and
//! amplitude of each channel. The final residual is noise and clutter. Its power in training cells outside all main lobes is the noise of a target.
//!
//! **Standard deviations.** For noise of power `s^2` a sample, amplitude `a` and `kappa_k = 2 pi (k - (K-1)/2) step / c`, to first order
//!
//! ```text
//! SNR = |a|^2 (sum w)^2 / (s^2 sum w^2),        var(phase) = 1 / (2 SNR)
//! var(path) = s^2 sum w^2 kappa^2 / (2 |a|^2 (sum w kappa^2)^2)
//! ```
//!
//! The maximum moves by the slope of the noise over the curvature of the peak: the real part of the noise's derivative has the variance `s^2 sum w^2 kappa^2 / 2`, the peak's curvature is `|a| sum w kappa^2`. Without a
//! window this is the Cramer-Rao bound; windows lose about a quarter. As `w` is even and `kappa` odd about the middle, errors of phase and path are uncorrelated. `tests/echoes.rs` compares with simulated noise.
//!
//! The range is half of the mean path of the channels, each at its own maximum.

use num_complex::Complex64;

use crate::targets::cfar::{Detector, Peak};
use crate::targets::profile::{Echoes, Profiler};

/// Rounds over all targets: each reduces the leakage of one into another by the leakage ratio.
const ROUNDS: usize = 3;
/// Newton steps a round; the start is within a sixteenth of the peak's width.
const STEPS: usize = 2;
/// Half-width of a target's main lobe under the available windows, range cells.
const LOBE_CELLS: usize = 2;
/// Training cells are searched up to this multiple of the detector's distance.
const FARTHER: usize = 4;
/// Least number of clear cells: they measure noise power to a third.
const MIN_CELLS: usize = 8;
/// Highest SNR claimed: samples are float32, and receivers are no better.
const MAX_SNR: f64 = 1e9;

/// Target in a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Echo {
    /// Range, metres: half of the mean path of all channels.
    pub range_m: f64,
    /// Standard deviation of the range, metres.
    pub range_sigma_m: f64,
    /// Phase of each channel, radians: `-2 pi f_m path / c` and the phase of reflection.
    pub phases_rad: Vec<f64>,
    /// Standard deviation of each phase, radians, RMS over the channels.
    pub phase_sigma_rad: f64,
    /// Power over the noise power in its range cell, of each channel.
    pub snr: Vec<f64>,
}

/// Paths with which a target is subtracted from the samples of the channels before others are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Subtraction {
    /// The path of each channel. Receivers `b` apart see paths that differ by up to `b`.
    #[default]
    PerChannel,
    /// One path for all channels, as in the embedded odometer (`subaperture_core::motion`). It leaves `(kappa b / 2)^2` of a target's power within its main lobe: -17 dB for half a wavelength at a
    /// fractional bandwidth of 0.4.
    Common,
}

/// Target during the estimation.
struct Found {
    /// Path common to all channels, at the maximum of their summed power, metres.
    path_m: f64,
    /// Path of each channel, metres: separate receivers see different paths.
    paths_m: Vec<f64>,
    amplitudes: Vec<Complex64>,
}

/// `S`, `dS/dp` and `d^2S/dp^2`.
type Slopes = [Complex64; 3];

/// Estimate the targets at these peaks.
pub(crate) fn echoes(
    profiler: &Profiler,
    detector: &Detector,
    samples: &Echoes,
    peaks: &[Peak],
    subtraction: Subtraction,
) -> Vec<Echo> {
    let mut left = samples.clone();
    let mut found: Vec<Found> = peaks
        .iter()
        .map(|peak| Found {
            path_m: profiler.path_m(peak.bin),
            paths_m: vec![profiler.path_m(peak.bin); samples.len()],
            amplitudes: vec![Complex64::ZERO; samples.len()],
        })
        .collect();
    for _ in 0..ROUNDS {
        for target in &mut found {
            add(profiler, &mut left, target, 1.0);
            for _ in 0..STEPS {
                target.path_m += step_m(profiler, &slopes(profiler, &left, target.path_m));
            }
            refine(profiler, &left, target, subtraction);
            add(profiler, &mut left, target, -1.0);
        }
    }
    let residual: Vec<Vec<f64>> = left.iter().map(|left| profiler.power(left)).collect();
    let bins: Vec<usize> = peaks.iter().map(|peak| peak.bin).collect();
    let each = found.into_iter().zip(peaks);
    each.map(|(target, peak)| {
        add(profiler, &mut left, &target, 1.0);
        let tops = slopes(profiler, &left, target.path_m);
        add(profiler, &mut left, &target, -1.0);
        let cells = noise_cells(profiler, detector, peak.bin, &bins);
        let noise = residual.iter().map(|power| {
            let sum: f64 = cells.iter().map(|&bin| power[bin]).sum();
            sum / cells.len().max(1) as f64
        });
        measured(profiler, target.path_m, &tops, noise)
    })
    .collect()
}

/// Add a target's echo times `sign`.
fn add(profiler: &Profiler, left: &mut Echoes, target: &Found, sign: f64) {
    if target.amplitudes.iter().all(|a| *a == Complex64::ZERO) {
        return;
    }
    for ((left, amplitude), path_m) in left.iter_mut().zip(&target.amplitudes).zip(&target.paths_m)
    {
        let own = sign * amplitude;
        for (z, phasor) in left.iter_mut().zip(profiler.phasors(-path_m)) {
            *z += own * phasor;
        }
    }
}

/// Estimate path and amplitude of each channel, starting from the common path.
///
/// With one path for all, the residual within a target's main lobe would be noise for its neighbours: see [`Subtraction::Common`].
fn refine(profiler: &Profiler, left: &Echoes, target: &mut Found, subtraction: Subtraction) {
    let total: f64 = profiler.window.iter().sum();
    let most_m = 0.5 * profiler.cell_m();
    let tops = slopes(profiler, left, target.path_m);
    for (c, top) in tops.iter().enumerate() {
        let (path_m, value) = match subtraction {
            Subtraction::Common => (target.path_m, top[0]),
            Subtraction::PerChannel => {
                let [slope, curvature] = bend(top);
                let path_m = target.path_m + limited(slope, curvature, most_m);
                (path_m, value(profiler, &left[c], path_m))
            }
        };
        target.paths_m[c] = path_m;
        target.amplitudes[c] = value / total;
    }
}

/// `S` of a channel.
fn value(profiler: &Profiler, samples: &[Complex64], path_m: f64) -> Complex64 {
    let phasors = profiler.phasors(path_m).zip(&profiler.window);
    let each = samples.iter().zip(phasors);
    each.map(|(z, (phasor, w))| z * phasor * w).sum()
}

/// Value, slope and curvature of each channel.
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

/// Newton step to the maximum of the summed power, at most one bin.
fn step_m(profiler: &Profiler, slopes: &[Slopes]) -> f64 {
    let [slope, curvature] = slopes
        .iter()
        .map(bend)
        .fold([0.0, 0.0], |[a, b], [c, d]| [a + c, b + d]);
    limited(slope, curvature, profiler.bin_m())
}

/// Step towards the maximum, at most `most`.
fn limited(slope: f64, curvature: f64, most: f64) -> f64 {
    match curvature < 0.0 {
        true => (-slope / curvature).clamp(-most, most),
        false if slope == 0.0 => 0.0,
        false => most.copysign(slope),
    }
}

/// Bins in which a target's noise is measured: the nearest training cells on either side outside the main lobes of all targets.
///
/// Within the main lobe of a subtracted target the residual is not noise: the fit has absorbed the noise of three real numbers a channel, and interference that it does not describe remains. Where a crowd of targets leaves
/// too few clear cells, all training cells count.
fn noise_cells(
    profiler: &Profiler,
    detector: &Detector,
    bin: usize,
    peaks: &[usize],
) -> Vec<usize> {
    let (_, count) = profiler.bins;
    let lobe = LOBE_CELLS * profiler.stride();
    let is_clear = |cell: &usize| peaks.iter().all(|peak| peak.abs_diff(*cell) > lobe);
    let [before, after] = detector.cells(bin, count, FARTHER);
    let training = detector.cells(bin, count, 1);
    let wanted = detector.training_cells();
    let clear: Vec<usize> = before
        .filter(is_clear)
        .take(wanted)
        .chain(after.filter(is_clear).take(wanted))
        .collect();
    match clear.len() >= wanted.min(MIN_CELLS) {
        true => clear,
        false => training.into_iter().flatten().collect(),
    }
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
            match noise * MAX_SNR > power {
                true => power / noise,
                false => MAX_SNR,
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
        range_m: 0.5 * profiler.within_interval_m(mean_path_m),
        range_sigma_m: 0.5 * (path_m2 * inverse).sqrt() / count,
        phases_rad: tops
            .iter()
            .map(|[value, ..]| libm::atan2(value.im, value.re))
            .collect(),
        phase_sigma_rad: (0.5 * inverse / count).sqrt(),
        snr,
    }
}
