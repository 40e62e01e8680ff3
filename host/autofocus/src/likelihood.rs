//! Likelihood of phase errors, from the histories of image tiles.
//!
//! Cells of a focused cross-range profile of clutter are independent and complex Gaussian, with a power that varies slowly (texture) or
//! abruptly (edges, bright points). With the power estimated by the mean over neighbouring cells, the negative log
//! likelihood of a profile is, up to constants,
//!
//! ```text
//! J = sum over x of ln P(x),   P = mean over neighbours of |I|^2,   I(x) = sum_n h_n exp(-j phi_n) exp(-j 2 pi n x / L)
//! ```
//!
//! which decreases as the powers become more unequal; defocusing by a wrong phase makes them more equal. Outside a tile the profile
//! is not focused, but its total power is known from that of the history: those cells count as clutter of one power,
//! so that power that leaves the tiles does not increase `J`. `J` averages over several sizes of neighbourhoods: single
//! cells respond to points, wide ones to texture. The gradient is analytic: two transforms per row.

use num_complex::Complex64;
use rayon::prelude::*;

use subaperture_fft::forward;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::phase::cis;

use super::split::Half;

/// Neighbourhoods: half cross-range cells and range cells on either side.
const NEIGHBOURS: [(usize, usize); 2] = [(2, 0), (4, 1)];

/// Fraction of the mean power added to each cell: differences below it do not count, as such cells contain noise and side lobes.
const FLOOR: f64 = 0.1;

/// History of a tile.
#[derive(Clone, Debug)]
pub(crate) struct TileRow {
    /// Channel and cross-range piece: rows of one strip in adjacent range cells are neighbours.
    pub(crate) strip: (usize, i64),
    /// Range cell of the row.
    pub(crate) bin: i64,
    /// Half of the range cells to which the row belongs.
    pub(crate) half: Half,
    /// Whether its range cell adjoins one of the other half, so that it is excluded from validation.
    pub(crate) on_border: bool,
    /// Values, one per pulse.
    pub(crate) values: Vec<Complex64>,
}

/// Histories for the likelihood of phases.
pub(crate) struct Texture<'a> {
    rows: Vec<&'a TileRow>,
    length: usize,
    /// Number of transform cells within a tile.
    cells: usize,
}

impl<'a> Texture<'a> {
    /// Likelihood of these rows, ordered by strip and range cell; tiles are `cells` cross-range cells wide.
    pub(crate) fn new(rows: Vec<&'a TileRow>, turns: usize, cells: f64) -> Self {
        // Half cells: the power of a point between two cells would depend on its position.
        let length = fast_length(2 * turns);
        let cells = (cells * length as f64 / turns as f64).round() as usize;
        Self {
            rows,
            length,
            cells: cells.clamp(1, length),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    pub(crate) fn rows(&self) -> &[&'a TileRow] {
        &self.rows
    }

    /// Index in the transform of cell `i` of a tile.
    fn at(&self, i: usize) -> usize {
        (i + self.length - self.cells / 2) % self.length
    }

    fn profiles(&self, phases_rad: &[f64]) -> Vec<Vec<Complex64>> {
        let fft = forward::<f64>(self.length);
        let phasors: Vec<Complex64> = phases_rad.iter().map(|&p| cis(-p)).collect();
        let one = |row: &&TileRow| {
            let mut profile = vec![Complex64::ZERO; self.length];
            for ((to, value), phasor) in profile.iter_mut().zip(&row.values).zip(&phasors) {
                *to = value * phasor;
            }
            fft.process(&mut profile);
            profile
        };
        self.rows.par_iter().map(one).collect()
    }

    /// Negative log likelihood of each row used for validation, nats per cell; the power estimate includes neighbouring rows.
    pub(crate) fn values_by_row(&self, phases_rad: &[f64]) -> Vec<f64> {
        let powers = self.powers(&self.profiles(phases_rad));
        let mut values = vec![0.0; powers.len()];
        for neighbours in NEIGHBOURS {
            for (value, row) in values
                .iter_mut()
                .zip(self.by_neighbours(&powers, neighbours))
            {
                *value += row.0 / (self.length * NEIGHBOURS.len()) as f64;
            }
        }
        let judging = values.into_iter().zip(&self.rows);
        judging
            .filter(|(_, row)| !row.on_border)
            .map(|(value, _)| value)
            .collect()
    }

    /// Mean over all cells of the negative log likelihood, nats; less is better.
    pub(crate) fn value(&self, phases_rad: &[f64]) -> f64 {
        let profiles = self.profiles(phases_rad);
        self.by_powers(&self.powers(&profiles)).0
    }

    /// Value, and derivatives by the phase of every pulse.
    pub(crate) fn gradient(&self, phases_rad: &[f64]) -> (f64, Vec<f64>) {
        let profiles = self.profiles(phases_rad);
        let (value, by_powers) = self.by_powers(&self.powers(&profiles));
        let fft = forward::<f64>(self.length);
        let turns = phases_rad.len();
        let each: Vec<Vec<f64>> = (self.rows.par_iter(), profiles, by_powers)
            .into_par_iter()
            .map(|(row, mut profile, by_power)| {
                let mut pulled = vec![Complex64::ZERO; self.length];
                for (i, by) in by_power.iter().enumerate() {
                    let x = self.at(i);
                    pulled[x] = profile[x].conj() * by;
                }
                std::mem::swap(&mut profile, &mut pulled);
                fft.process(&mut profile);
                let terms = row.values.iter().zip(phases_rad).zip(&profile);
                terms
                    .map(|((value, &phase), sum)| 2.0 * (value * cis(-phase) * sum).im)
                    .collect()
            })
            .collect();
        let mut gradient = vec![0.0; turns];
        for row in each {
            gradient.iter_mut().zip(row).for_each(|(g, r)| *g += r);
        }
        (value, gradient)
    }

    fn powers(&self, profiles: &[Vec<Complex64>]) -> Vec<Vec<f64>> {
        let scale = 1.0 / self.length as f64;
        let power = |profile: &Vec<Complex64>| {
            (0..self.cells)
                .map(|i| profile[self.at(i)].norm_sqr() * scale)
                .collect()
        };
        profiles.par_iter().map(power).collect()
    }

    /// Value, and derivatives by the power of every cell (`|I|^2`, without the scale of [`Self::powers`]).
    fn by_powers(&self, powers: &[Vec<f64>]) -> (f64, Vec<Vec<f64>>) {
        let count = (self.rows.len() * self.length * NEIGHBOURS.len()) as f64;
        let mut value = 0.0;
        let mut all: Vec<Vec<f64>> = powers.iter().map(|row| vec![0.0; row.len()]).collect();
        for neighbours in NEIGHBOURS {
            let (values, by): (Vec<f64>, Vec<Vec<f64>>) =
                self.by_neighbours(powers, neighbours).into_iter().unzip();
            value += values.iter().sum::<f64>();
            for (to, by) in all.iter_mut().zip(self.over_range_cells(&by, neighbours.1)) {
                to.iter_mut().zip(by).for_each(|(to, by)| *to += by);
            }
        }
        let scale = 1.0 / (count * self.length as f64);
        all.iter_mut().flatten().for_each(|by| *by *= scale);
        (value / count, all)
    }

    /// Sum of logarithms over all cells of each row, and derivatives by the sums of power over neighbouring range cells.
    fn by_neighbours(
        &self,
        powers: &[Vec<f64>],
        (across, along): (usize, usize),
    ) -> Vec<(f64, Vec<f64>)> {
        let energies: Vec<Vec<f64>> = self.rows.iter().map(|row| vec![energy(row)]).collect();
        let energies = self.over_range_cells(&energies, along);
        let total: f64 = energies.iter().flatten().sum();
        let floor = FLOOR * total / (self.rows.len() * self.length) as f64;
        if !(floor > 0.0 && floor.is_finite()) {
            return powers
                .iter()
                .map(|row| (0.0, vec![0.0; row.len()]))
                .collect();
        }
        let outside = (self.length - self.cells) as f64;
        let rows = self.over_range_cells(powers, along);
        rows.par_iter()
            .zip(&energies)
            .map(|(row, energy)| {
                let means = smoothed(row, across);
                let mut value: f64 = means.iter().map(|p| libm::log(p + floor)).sum();
                let by: Vec<f64> = means.iter().map(|p| 1.0 / (p + floor)).collect();
                let mut by = smoothed(&by, across);
                if outside > 0.0 {
                    let left = (energy[0] - row.iter().sum::<f64>()).max(0.0) / outside + floor;
                    value += outside * libm::log(left);
                    by.iter_mut().for_each(|by| *by -= 1.0 / left);
                }
                // Relative power, for independence of the recording's scale.
                (value - self.length as f64 * libm::log(floor), by)
            })
            .collect()
    }

    /// Sums over neighbouring range cells; its own transpose.
    fn over_range_cells(&self, rows: &[Vec<f64>], along: usize) -> Vec<Vec<f64>> {
        let one = |m: usize| {
            let mut sum = rows[m].clone();
            let low = m.saturating_sub(along);
            let high = (m + along + 1).min(rows.len());
            for (other, row) in rows.iter().enumerate().take(high).skip(low) {
                let (a, b) = (self.rows[m], self.rows[other]);
                let near = a.bin.abs_diff(b.bin) <= along as u64;
                if other != m && a.strip == b.strip && near {
                    sum.iter_mut().zip(row).for_each(|(s, v)| *s += v);
                }
            }
            sum
        };
        (0..rows.len()).into_par_iter().map(one).collect()
    }
}

fn energy(row: &TileRow) -> f64 {
    row.values.iter().map(|value| value.norm_sqr()).sum()
}

/// Moving average over `across` cells on either side. Values beyond the ends are zero, so that the operator is its own transpose.
fn smoothed(values: &[f64], across: usize) -> Vec<f64> {
    let scale = 1.0 / (2 * across + 1) as f64;
    let count = values.len();
    (0..count)
        .map(|i| {
            let from = i.saturating_sub(across);
            values[from..(i + across + 1).min(count)]
                .iter()
                .sum::<f64>()
                * scale
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn likelihood_gradient_equals_central_differences() {
        let mut state = 9u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let rows: Vec<TileRow> = (0..6)
            .map(|bin| TileRow {
                strip: (0, bin / 4),
                bin,
                half: Half::Even,
                on_border: false,
                values: (0..20)
                    .map(|_| Complex64::new(uniform(), uniform()))
                    .collect(),
            })
            .collect();
        for cells in [9.0, 20.0] {
            let texture = Texture::new(rows.iter().collect(), 20, cells);
            let at: Vec<f64> = (0..20).map(|n| (f64::from(n) * 1.7).sin()).collect();
            let (value, gradient) = texture.gradient(&at);
            assert_eq!(value, texture.value(&at));
            for n in 0..20 {
                let step = 1e-5;
                let shifted = |sign: f64| {
                    let mut there = at.clone();
                    there[n] += sign * step;
                    texture.value(&there)
                };
                let difference = (shifted(1.0) - shifted(-1.0)) / (2.0 * step);
                // The rounding of the sums over two steps is 1e-10; the third derivative adds the square of the step.
                assert!((difference - gradient[n]).abs() < 1e-7, "{n}");
            }
        }
    }
}
