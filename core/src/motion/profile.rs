//! Range profiles of a pulse and CFAR detection of targets.
//!
//! **Equation.** With `w` a window symmetric about the middle of the band and range `u` in cells, `u = path F step / c`:
//!
//! ```text
//! S_c(u) = sum_k w_k z_ck exp(+j x_k u),   x_k = 2 pi (k - (F-1)/2) / F,        power(l) = sum_c |S_c(l F / R)|^2
//! detected if  power > k times the mean, or the r-th smallest, of N training cells
//! ```
//!
//! with `k` from [`super::threshold`]. A window correlates neighbouring cells: their sum is treated as one of
//! `N' = N^2 / sum |rho_ij|^2` independent cells, and ordered cells are treated as independent. A profile is periodic, so
//! every cell has equal numbers of training cells on both sides; ranges outside the limits contribute noise as well.
//!
//! A peak is a maximum within one cell. Values below the window's sidelobe level relative to the strongest cell are
//! ignored. **Cost**: one transform of `R` points per channel, and `N` sums or
//! comparisons per peak.

use num_complex::Complex32;

use super::factor::{cell_averaging_factor, order_statistic_factor};
use super::setup::{Axis, Setup};
use super::threshold::rank_of;
use crate::{Turns, range};

/// Detected peak.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    /// Range in cells, counted from the first bin at or beyond the nearest range.
    pub(super) cells: f64,
    power: f32,
}

/// Settings of the CFAR detector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detector {
    guard: usize,
    training: usize,
    /// Rank of the training cell compared with, from 1; 0 for the mean of all.
    rank: usize,
    /// Threshold factor over that level.
    factor: f32,
    /// Highest sidelobe of the window as a power ratio, with a margin of two.
    sidelobe_ratio: f32,
}

impl Peak {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        cells: 0.0,
        power: 0.0,
    };
}

impl Detector {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        guard: 0,
        training: 0,
        rank: 0,
        factor: 0.0,
        sidelobe_ratio: 0.0,
    };

    /// Create a detector for profiles of `channels` channels. `row` and `power` are work buffers of `R` elements.
    pub(super) fn new(
        setup: &Setup,
        axis: &Axis,
        channels: usize,
        weights: &[f32],
        row: &mut [Complex32],
        power: &mut [f32],
    ) -> Self {
        let flat = weights.iter().map(|w| Complex32::new(*w, 0.0));
        compress(axis, flat, row);
        for (to, z) in power.iter_mut().zip(row.iter()) {
            *to = z.norm_sqr();
        }
        let half = power.get(..axis.bins / 2).unwrap_or(&[]);
        let null = half
            .windows(2)
            .position(|pair| matches!(pair, [a, b] if b > a));
        let beyond = half.get(null.unwrap_or(half.len())..).unwrap_or(&[]);
        let highest = beyond.iter().fold(0.0f32, |most, p| most.max(*p));
        let training = usize::from(setup.training);
        let probability = setup.false_alarm_probability;
        let count = 2 * training;
        let (rank, factor) = if setup.rank > 0.0 {
            let rank = rank_of(setup.rank, count);
            (
                rank,
                order_statistic_factor(probability, channels, count, rank),
            )
        } else {
            let cells = count as f64;
            let effective = cells * cells / (2.0 * correlated_variance(axis, weights, training));
            (
                0,
                effective * cell_averaging_factor(probability, channels, effective),
            )
        };
        Self {
            guard: setup.guard.into(),
            training,
            rank,
            factor: factor as f32,
            sidelobe_ratio: 2.0 * highest,
        }
    }

    /// Detect peaks at all ranges, strongest first, as many as `peaks` can hold. Returns their number.
    pub(super) fn search(&self, axis: &Axis, power: &[f32], peaks: &mut [Peak]) -> usize {
        let strongest = power.iter().fold(0.0f32, |most, p| most.max(*p));
        let least = self.sidelobe_ratio * strongest;
        let bins = axis.bins;
        let at = |bin: usize| power.get(bin & bins.wrapping_sub(1)).copied();
        let at = |bin: usize| at(bin).unwrap_or(0.0);
        let [near, _] = axis.ranges_cells;
        let first = libm::ceil(near / axis.cells_a_bin);
        let first_bin = first as u64 as usize;
        let mut count = 0;
        for i in 0..bins {
            let bin = first_bin.wrapping_add(i);
            let own = at(bin);
            // Also skips NaN.
            if !(own >= least && own > 0.0) {
                continue;
            }
            let neighbours = 1..=axis.stride;
            let is_peak = neighbours
                .clone()
                .all(|d| at(bin.wrapping_sub(d)) < own && at(bin.wrapping_add(d)) <= own);
            if !is_peak {
                continue;
            }
            let cells = (1..=self.training).flat_map(|cell| {
                let away = (self.guard + cell) * axis.stride;
                [at(bin.wrapping_sub(away)), at(bin.wrapping_add(away))]
            });
            if self.exceeds(own, cells) {
                let peak = Peak {
                    cells: (first + i as f64) * axis.cells_a_bin,
                    power: own,
                };
                keep(peaks, &mut count, peak);
            }
        }
        count
    }
}

impl Detector {
    /// Whether a power exceeds the threshold over the mean or an order statistic of the training cells. NaN counts as the largest
    /// cell.
    fn exceeds(&self, own: f32, cells: impl Iterator<Item = f32>) -> bool {
        if self.rank == 0 {
            let level = cells.sum::<f32>() / (2 * self.training) as f32;
            return own > self.factor * level;
        }
        // The power exceeds the threshold of the `rank`-th smallest cell if it exceeds those of as many cells.
        cells.filter(|cell| own > self.factor * cell).count() >= self.rank
    }
}

/// Insert a peak into a list in descending power. The weakest is dropped if the list is full.
fn keep(peaks: &mut [Peak], count: &mut usize, mut peak: Peak) {
    for held in peaks.iter_mut().take(*count) {
        if peak.power > held.power {
            core::mem::swap(held, &mut peak);
        }
    }
    if let Some(place) = peaks.get_mut(*count) {
        *place = peak;
        *count += 1;
    }
}

/// `S` of weighted samples at all bins, up to a phase that varies with range: for powers only.
pub(super) fn compress(
    axis: &Axis,
    weighted: impl Iterator<Item = Complex32>,
    row: &mut [Complex32],
) {
    let (f, r) = (axis.frequencies, axis.bins);
    for (k, value) in weighted.enumerate().take(f) {
        if let Some(cell) = row.get_mut(range::column(k, f, r)) {
            *cell = value;
        }
    }
    range::compress(row, f);
}

/// Variance of a sum of `count` consecutive cells in units of one cell's variance: `sum_ij |rho_(i-j)|^2`.
fn correlated_variance(axis: &Axis, weights: &[f32], count: usize) -> f64 {
    let total: f32 = weights.iter().map(|w| w * w).sum();
    let mut sum = 0.0;
    for lag in 0..count {
        let step = Turns::from_f64((lag * axis.stride) as f64 / axis.bins as f64);
        let mut alike = Complex32::ZERO;
        for (k, w) in weights.iter().enumerate() {
            alike += step.times(k as i64).phasor() * (w * w);
        }
        let pairs = (count - lag) as f64 * if lag == 0 { 1.0 } else { 2.0 };
        sum += pairs * f64::from((alike / total).norm_sqr());
    }
    sum
}
