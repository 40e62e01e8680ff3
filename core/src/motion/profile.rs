//! Range profiles of the channels of a pulse, and targets above their noise.
//!
//! **Equation.** With `w` a window symmetric about the middle of the band, and range `u` in cells, `u = path F step / c`:
//!
//! ```text
//! S_c(u) = sum_k w_k z_ck exp(+j x_k u),   x_k = 2 pi (k - (F-1)/2) / F,        power(l) = sum_c |S_c(l F / R)|^2
//! detected if  power > k times the mean, or the r-th smallest, of N training cells
//! ```
//!
//! with `k` of [`super::threshold`]. Under a window neighbouring cells are alike: their sum is taken for one of `N' = N^2 / sum |rho_ij|^2` cells, and ordered ones for independent. A profile is
//! periodic, so that every cell has as many training cells on either side; what is too near or too far for a target is noise as well.
//!
//! A peak is not exceeded within a cell; what is below the window's side lobes beside the strongest cell is none. **Cost** a transform of `R` a channel, and `N` sums or `N^2 / 4` comparisons a peak.

use num_complex::Complex32;

use super::setup::{Axis, MOST_TRAINING, Setup};
use super::threshold::{averaging, ordering, place};
use crate::{Turns, range};

/// A peak above its threshold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    /// Its range, counted on from the nearest one told.
    pub(super) cells: f64,
    power: f32,
}

/// How profiles are searched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detector {
    guard: usize,
    training: usize,
    /// Which of the training cells in order, from 1; 0 for the mean of all.
    rank: usize,
    /// Threshold over that.
    factor: f32,
    /// Highest side lobe of the window, as a ratio of powers, and a little.
    lobe: f32,
}

impl Peak {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        cells: 0.0,
        power: 0.0,
    };
}

impl Detector {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        guard: 0,
        training: 0,
        rank: 0,
        factor: 0.0,
        lobe: 0.0,
    };

    /// For profiles of so many channels; `row` and `power` are scratch of `R`.
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
            let rank = place(setup.rank, count);
            (rank, ordering(probability, channels, count, rank))
        } else {
            let cells = count as f64;
            let effective = cells * cells / (2.0 * scatter(axis, weights, training));
            (0, effective * averaging(probability, channels, effective))
        };
        Self {
            guard: setup.guard.into(),
            training,
            rank,
            factor: factor as f32,
            lobe: 2.0 * highest,
        }
    }

    /// Peaks of all ranges, strongest first, as many as `peaks` has room for; how many there are.
    pub(super) fn search(&self, axis: &Axis, power: &[f32], peaks: &mut [Peak]) -> usize {
        let strongest = power.iter().fold(0.0f32, |most, p| most.max(*p));
        let least = self.lobe * strongest;
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
            // Not of numbers that are none.
            if !(own >= least && own > 0.0) {
                continue;
            }
            let beside = 1..=axis.stride;
            let is_peak = beside
                .clone()
                .all(|d| at(bin.wrapping_sub(d)) < own && at(bin.wrapping_add(d)) <= own);
            if !is_peak {
                continue;
            }
            let cells = (1..=self.training).flat_map(|cell| {
                let away = (self.guard + cell) * axis.stride;
                [at(bin.wrapping_sub(away)), at(bin.wrapping_add(away))]
            });
            if own > self.factor * self.level(cells) {
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
    /// What of the training cells is compared with.
    fn level(&self, cells: impl Iterator<Item = f32>) -> f32 {
        if self.rank == 0 {
            return cells.sum::<f32>() / (2 * self.training) as f32;
        }
        // The smallest so far, ascending, of which the last is the one wanted.
        let mut smallest = [f32::INFINITY; 2 * MOST_TRAINING as usize];
        let smallest = smallest.get_mut(..self.rank).unwrap_or(&mut []);
        for mut cell in cells {
            // A number that is none counts as the largest.
            for held in smallest.iter_mut() {
                if cell < *held {
                    core::mem::swap(held, &mut cell);
                }
            }
        }
        smallest.last().copied().unwrap_or(f32::INFINITY)
    }
}

/// Puts a peak into a list that falls in power; the weakest goes if there is no room.
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

/// `S` of weighted samples at all bins, but for a phase that grows along range: for powers alone.
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

/// By how many cells' worth a sum of so many in a row scatters: `sum_ij |rho_(i-j)|^2`.
fn scatter(axis: &Axis, weights: &[f32], count: usize) -> f64 {
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
