//! Prediction of the error of a frequency-domain former before processing.
//!
//! The image is linear in the samples: for pixel `p` a former sums `w_k v_n z[n][k] h~(p, n, k)`, and the exact sum
//! has `h = exp(j kappa_k path_n(p) / 2)` in place of `h~`. For any samples, the error of the image is that of
//! `h~ / h - 1`, and its RMS over pulses and frequencies, weighted as the samples are, is the relative RMS error of
//! the image (by Parseval, if the image covers all scatterers). It has two parts.
//!
//! **Track.** `h~` assumes a pulse on the line, to which motion compensation has moved it ([`Motion`]). The residual path error,
//! `exp(j kappa left_n(p) / 2)`, is evaluated for all pulses at points throughout the grid, including corners and edges ([`probes`]).
//!
//! **Line.** On the line `h~` is a sum over the along-track wavenumbers retained by the former,
//!
//! ```text
//! h~(r, u; kappa) = sum_q T(kx_q / kappa) A(kappa, kx_q; r) exp(j phase(kappa, kx_q; r)) exp(j kx_q u)
//! ```
//!
//! with the taper `T` of the band, the stationary-phase amplitude and correction `A`, and the phase of the method,
//! `r kr` for omega-K and its expansion for the range-Doppler algorithm. It is evaluated directly at
//! [`FREQUENCIES`] frequencies, [`RANGES`] ranges and [`OFFSETS`] along-track positions from the first to the last
//! at which a pulse sees a pixel (fewer for many wavenumbers: [`Detail`]). It therefore includes the ends, slow-time periodicity and neglected terms.
//!
//! Additional terms are the kernels, -107 dB in each of three axes, and float32 ([`FLOOR`]), and the kernels of motion compensation
//! ([`Motion::floors`]).

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_signal::phase::cis;

use super::motion::Motion;
use super::{Axes, RangeMethod, stationary_phase_error};
use crate::probes::{Shares, probes, rough, turned};
use crate::{Reason, Remedy, rounding};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Weights};

/// Number of frequencies from first to last.
const FREQUENCIES: usize = 9;
/// Number of ranges from nearest to farthest.
const RANGES: usize = 5;
/// Number of along-track positions, denser towards both ends, where the band of directions rings.
const OFFSETS: usize = 65;
/// Largest number of pulses over which the line error of a pixel is averaged.
const PULSES: usize = 16_384;
/// Error of three kernels (-107 dB each) with their tables (-114 dB), and float32.
pub(super) const FLOOR: f64 = 1.0e-5;

/// Predicted relative RMS error of the worst pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    /// Error from deviations of the track from a line.
    pub(crate) track: f64,
    /// Error on a straight track.
    pub(crate) line: f64,
}

impl Prediction {
    /// Total error, dB; the track and line errors may add in phase. `others` are further errors.
    pub(crate) fn total_db(&self, others: &[f64]) -> f64 {
        rounding::total_db(&[&[self.track + self.line, FLOOR], others].concat())
    }

    /// Limiting effect; `line` is the reason for a straight track.
    pub(crate) fn limit(&self, line: &Reason) -> Reason {
        if self.line > self.track {
            return line.clone();
        }
        let why = format!(
            "the track is not straight and even, and motion compensation to a line leaves an error of {:.0} dB at \
             the grid's worst corner, whose line of sight differs most",
            20.0 * libm::log10(self.track)
        );
        Reason::new(why).helped_by(&[
            Remedy::OtherFormer(&["rdbp", "ffbp", "bp"]),
            Remedy::SmallerGrid,
        ])
    }
}

/// Track error over `grid` after compensation by `motion`, for samples of the given wavenumbers, and its
/// part that varies fast from pulse to pulse.
pub(super) fn of_track(
    collection: &Collection,
    weights: &Weights,
    grid: &ImageGrid,
    motion: &Motion,
    wavenumbers: &[f64],
) -> [f64; 2] {
    let slow = Shares::new(&weights.slow);
    let fast = Shares::new(&weights.fast);
    let squares = wavenumbers.iter().map(|kappa| kappa * kappa);
    let rms_wavenumber = fast.worst(squares).sqrt();
    let points = probes(grid);
    let errors = points.par_iter().map(|&point| {
        let pulses = collection.pulses.iter().enumerate();
        let left_rad =
            pulses.map(|(n, pulse)| rms_wavenumber * motion.left_m(n, pulse, point) / 2.0);
        let left_rad: Vec<f64> = left_rad.collect();
        [
            slow.worst(left_rad.iter().map(|&left_rad| turned(left_rad))),
            slow.worst(rough(&left_rad).map(turned)),
        ]
    });
    let most = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
    errors.reduce(|| [0.0; 2], most).map(f64::sqrt)
}

/// Error of `method` on a straight track over `grid`, for samples of the given wavenumbers.
pub(super) fn of_line(
    weights: &Weights,
    grid: &ImageGrid,
    motion: &Motion,
    (axes, wavenumbers): (&Axes, &[f64]),
    method: &dyn RangeMethod,
) -> f64 {
    let slow = Shares::new(&weights.slow);
    let line = Line::new(axes, wavenumbers, weights, method);
    let points = probes(grid);
    let errors = points.iter().map(|&point| line.at(point, motion, &slow));
    errors.fold(0.0, f64::max).sqrt()
}

/// Largest number of terms of the sum over wavenumbers, over all frequencies, ranges and positions: about one second.
const MAX_TERMS: usize = 400_000_000;

/// Sampling density of the line error: frequencies, ranges and along-track positions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Detail {
    frequencies: usize,
    ranges: usize,
    offsets: usize,
}

impl Detail {
    const ALL: [Self; 3] = [
        Self::new(FREQUENCIES, RANGES, OFFSETS),
        Self::new(5, 3, OFFSETS),
        Self::new(3, 2, 33),
    ];

    const fn new(frequencies: usize, ranges: usize, offsets: usize) -> Self {
        Self {
            frequencies,
            ranges,
            offsets,
        }
    }

    /// Largest sampling density that is feasible for the number of wavenumbers.
    fn of(num_bins: usize) -> Self {
        let fits = |detail: &&Self| {
            let each = detail.frequencies * detail.ranges * detail.offsets;
            each.saturating_mul(num_bins) <= MAX_TERMS
        };
        let [.., least] = Self::ALL;
        Self::ALL.iter().find(fits).copied().unwrap_or(least)
    }
}

/// Along-track positions, `middle - half cos(pi i / (count - 1))`.
#[derive(Clone, Copy)]
struct Offsets {
    middle_m: f64,
    half_m: f64,
    count: usize,
}

impl Offsets {
    fn at(&self, i: usize) -> f64 {
        self.middle_m - self.half_m * libm::cos(PI * i as f64 / (self.count - 1) as f64)
    }

    /// Fractional index of a position.
    fn index(&self, place_m: f64) -> f64 {
        let cosine = ((self.middle_m - place_m) / self.half_m).clamp(-1.0, 1.0);
        libm::acos(cosine) / PI * (self.count - 1) as f64
    }
}

/// Mean square errors on the line over along-track positions and ranges.
struct Line {
    offsets: Offsets,
    ranges_m: Vec<f64>,
    /// Errors by range and position.
    errors: Vec<Vec<f64>>,
}

impl Line {
    fn new(axes: &Axes, wavenumbers: &[f64], weights: &Weights, method: &dyn RangeMethod) -> Self {
        let [first_m, last_m] = axes.reach_m;
        let detail = Detail::of(axes.num_bins);
        let offsets = Offsets {
            middle_m: (first_m + last_m) / 2.0,
            half_m: (last_m - first_m) / 2.0,
            count: detail.offsets,
        };
        let [near_m, far_m] = axes.range_m;
        let mut ranges_m: Vec<f64> = (0..detail.ranges)
            .map(|i| near_m + (far_m - near_m) * i as f64 / (detail.ranges - 1) as f64)
            .collect();
        ranges_m.dedup();
        // Bands of frequencies, each with its weight at the centre.
        let count = wavenumbers.len();
        let mut chosen: Vec<usize> = (0..detail.frequencies)
            .map(|i| i * (count - 1) / (detail.frequencies - 1))
            .collect();
        chosen.dedup();
        let near = |k: usize| {
            let distance = |i: &usize| chosen[*i].abs_diff(k);
            (0..chosen.len()).min_by_key(distance).unwrap_or(0)
        };
        let mut shares = vec![0.0; chosen.len()];
        let sum: f64 = weights.fast.iter().sum();
        for (k, weight) in weights.fast.iter().enumerate() {
            shares[near(k)] += weight / sum;
        }
        let jobs: Vec<(f64, f64, f64)> = ranges_m
            .iter()
            .flat_map(|&range_m| {
                let each = chosen.iter().zip(&shares);
                each.map(move |(&k, &share)| (range_m, wavenumbers[k], share))
            })
            .collect();
        let all: Vec<Vec<f64>> = jobs
            .par_iter()
            .map(|&(range_m, kappa, share)| {
                let of_one = along(axes, method, range_m, kappa, offsets);
                of_one.into_iter().map(|error| error * share).collect()
            })
            .collect();
        let errors = all.chunks(chosen.len()).map(|of_range| {
            let at = |i: usize| of_range.iter().map(|errors| errors[i]).sum::<f64>();
            (0..offsets.count).map(at).collect()
        });
        Self {
            offsets,
            errors: errors.collect(),
            ranges_m,
        }
    }

    /// Error of a pixel: the mean over pulses, at the worse of the two neighbouring ranges.
    fn at(&self, point: DVec3, motion: &Motion, slow: &Shares) -> f64 {
        let track = &motion.positions.track;
        let (along_m, range_m) = track.along_and_range_m(point);
        let after = self.ranges_m.partition_point(|&r| r < range_m);
        let about = after.saturating_sub(1)..=after.min(self.ranges_m.len() - 1);
        let (mut sums, mut shares) = ([0.0; 2], [0.0; 2]);
        let every = track.num_pulses.div_ceil(PULSES);
        let worst: Vec<f64> = (0..self.offsets.count)
            .map(|i| {
                let of_ranges = self.errors[about.clone()].iter().map(|errors| errors[i]);
                of_ranges.fold(0.0, f64::max)
            })
            .collect();
        for n in (0..track.num_pulses).step_by(every) {
            let index = self.offsets.index(along_m - motion.positions.along_m(n));
            let i = (index as usize).min(self.offsets.count - 2);
            let t = index - i as f64;
            let error = worst[i] * (1.0 - t) + worst[i + 1] * t;
            for j in 0..2 {
                sums[j] += slow.0[n][j] * error;
                shares[j] += slow.0[n][j];
            }
        }
        (sums[0] / shares[0]).max(sums[1] / shares[1])
    }
}

/// `|h~ / h - 1|^2` at one range and frequency over along-track positions.
fn along(
    axes: &Axes,
    method: &dyn RangeMethod,
    range_m: f64,
    kappa: f64,
    offsets: Offsets,
) -> Vec<f64> {
    let kx_step = axes.along_wavenumber_step;
    let steps: Vec<Complex64> = (0..offsets.count)
        .map(|i| cis(kx_step * offsets.at(i)))
        .collect();
    let mut turns: Vec<Complex64> = (0..offsets.count)
        .map(|i| cis(axes.along_wavenumber(0) * offsets.at(i)))
        .collect();
    let mut sums = vec![Complex64::ZERO; offsets.count];
    let reference_m = axes.reference_range_m();
    for q in 0..axes.num_bins {
        let kx = axes.along_wavenumber(q);
        let taper = axes.taper.at(kx / kappa);
        if taper != 0.0 {
            let kr = (kappa * kappa - kx * kx).sqrt();
            let phase_rad = method.phase_rad(kappa, kx, range_m, reference_m);
            let value = cis(phase_rad)
                * stationary_phase_error(reference_m * kr)
                * (taper * kappa / (kr * kr.sqrt()));
            for (sum, turn) in sums.iter_mut().zip(&turns) {
                *sum += value * turn;
            }
        }
        for (turn, step) in turns.iter_mut().zip(&steps) {
            *turn *= step;
        }
    }
    let constant = cis(FRAC_PI_4) * TAU.sqrt() * range_m.sqrt() / axes.period_m;
    let carrier = axes.range.carrier;
    let bracket =
        stationary_phase_error(range_m * carrier) / stationary_phase_error(reference_m * carrier);
    sums.into_iter()
        .enumerate()
        .map(|(i, sum)| {
            let path_m = libm::hypot(range_m, offsets.at(i));
            let exact = cis(kappa * path_m);
            (sum * constant * bracket * exact.conj() - 1.0).norm_sqr()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::axes::MAX_BINS;
    use super::*;

    #[test]
    fn line_sampling_decreases_with_number_of_wavenumbers() {
        let [closest, .., coarsest] = Detail::ALL;
        assert_eq!(Detail::of(100_000), closest);
        assert_eq!(Detail::of(1_000_000), coarsest);
        for bins in [10, 136_000, 137_000, 400_000, 500_000, MAX_BINS as usize] {
            let Detail {
                frequencies,
                ranges,
                offsets,
            } = Detail::of(bins);
            assert!(bins * frequencies * ranges * offsets <= MAX_TERMS, "{bins}");
        }
    }
}
