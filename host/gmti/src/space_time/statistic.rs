//! Detection statistic of a motion hypothesis, integrated over sub-CPIs.
//!
//! In sub-CPI `m` the snapshot `x_m` at the place of the hypothesis has the steering vector `s_m`, of the elements `exp(-j 2 pi f_c a_c / c)` times the response of each bin, with the exact
//! relative path `a_c` of each channel. With the covariance `R_m`,
//!
//! ```text
//! z_m = s_m^H R_m^-1 x_m,   q_m = s_m^H R_m^-1 s_m
//! coherent:      |sum_m z_m|^2 / sum_m q_m
//! non-coherent:  sum_m |z_m|^2 / q_m
//! ```
//!
//! The coherent statistic is the generalised likelihood ratio of a target of constant amplitude in independent clutter of known covariance. Without a target it is exponential of mean 1;
//! with one, its SNR is `|A|^2 sum_m q_m`. The non-coherent statistic suits targets whose phase is not predicted over the aperture; it is a Gamma variable of shape `M` without a target.

use num_complex::{Complex32, Complex64};

use super::cube::{Cube, OVERSAMPLING};
use super::geometry::Place;
use super::training::{Tile, Tiles};
use crate::adaptive::{power, product};

/// Terms of the statistic in one sub-CPI.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Term {
    /// Matched filter output `s^H R^-1 x`.
    pub(super) filtered: Complex64,
    /// SNR of a target of amplitude 1, `s^H R^-1 s`.
    pub(super) gain: f64,
}

impl Term {
    /// Statistic of the sub-CPI alone.
    pub(super) fn level(&self) -> f64 {
        match self.gain > 0.0 {
            true => self.filtered.norm_sqr() / self.gain,
            false => 0.0,
        }
    }
}

/// Statistic of a hypothesis over all sub-CPIs.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Integrated {
    /// Coherent statistic: estimate of SNR + 1.
    pub coherent: f64,
    /// Non-coherent statistic: sum over sub-CPIs of the estimates of SNR + 1 in each.
    pub non_coherent: f64,
    /// Estimate of the amplitude of the target, square root of the radar cross-section in m^2.
    #[serde(skip)]
    pub amplitude: Complex64,
    /// SNR of a target of amplitude 1 after coherent integration: `sum_m q_m`, in 1 / m^2 of radar cross-section.
    pub gain: f64,
    /// Number of sub-CPIs whose maps contain the hypothesis.
    pub sub_cpis: usize,
}

impl Integrated {
    /// Sum over terms of sub-CPIs.
    pub(super) fn of(terms: impl Iterator<Item = Term>) -> Self {
        let (mut sum, mut integrated) = (Complex64::ZERO, Self::default());
        for term in terms.filter(|term| term.gain > 0.0) {
            sum += term.filtered;
            integrated.gain += term.gain;
            integrated.non_coherent += term.level();
            integrated.sub_cpis += 1;
        }
        if integrated.gain > 0.0 {
            integrated.coherent = sum.norm_sqr() / integrated.gain;
            integrated.amplitude = sum / integrated.gain;
        }
        integrated
    }
}

/// Snapshot of a place with the covariance of its tile.
pub(super) struct Snapshot<'a> {
    pub(super) tile: &'a Tile,
    /// Whitened values of channels and bins.
    white: Vec<Complex64>,
}

/// Buffers of one thread.
#[derive(Clone, Default)]
pub(super) struct Scratch {
    values: Vec<Complex32>,
    steering: Vec<Complex64>,
}

impl<'a> Snapshot<'a> {
    /// Tile of a place in a sub-CPI. `None` outside of the maps, or without training cells.
    pub(super) fn tile(
        cube: &Cube,
        tiles: &'a Tiles,
        sub_cpi: usize,
        place: &Place,
    ) -> Option<&'a Tile> {
        let bins = cube.bins(place);
        let inside = |bin: f64, count: usize| (0.0..count as f64 - 1.0).contains(&bin);
        let within = inside(bins[0], cube.axes.dopplers) && inside(bins[1], cube.axes.ranges);
        let cell = bins.map(|bin| (bin + 0.5) as usize);
        within.then(|| tiles.tile(cube, sub_cpi, cell))?
    }

    /// Snapshot of a place in a sub-CPI with the covariance of a tile, with `echo` added to its values. `None` outside of the maps.
    pub(super) fn at(
        cube: &Cube,
        tile: &'a Tile,
        sub_cpi: usize,
        place: &Place,
        echo: impl FnOnce(&mut [Complex32]),
        scratch: &mut Scratch,
    ) -> Option<Self> {
        let size = tile.whitener.size();
        let half = (size / cube.channels() / 2) as f64;
        let [doppler, range] = cube.bins(place);
        scratch.values.resize(size, Complex32::ZERO);
        for (j, values) in scratch.values.chunks_exact_mut(cube.channels()).enumerate() {
            let bin = doppler + (j as f64 - half) * OVERSAMPLING as f64;
            if !cube.interpolate(sub_cpi, [bin, range], values) {
                return None;
            }
        }
        echo(&mut scratch.values);
        Some(Self::of_values(tile, &scratch.values))
    }

    /// Snapshot of a cell of the maps.
    pub(super) fn of_cell(
        cube: &Cube,
        tiles: &'a Tiles,
        sub_cpi: usize,
        [doppler, range]: [usize; 2],
        scratch: &mut Scratch,
    ) -> Option<Self> {
        let size = tiles.degrees_of_freedom();
        let half = size / cube.channels() / 2 * OVERSAMPLING;
        let tile = tiles.tile(cube, sub_cpi, [doppler, range])?;
        let bins = doppler.checked_sub(half)?..doppler + half + 1;
        if bins.end > cube.axes.dopplers {
            return None;
        }
        scratch.values.resize(size, Complex32::ZERO);
        let values = scratch.values.chunks_exact_mut(cube.channels());
        for (bin, values) in bins.step_by(OVERSAMPLING).zip(values) {
            cube.cell(sub_cpi, [bin, range], values);
        }
        Some(Self::of_values(tile, &scratch.values))
    }

    fn of_values(tile: &'a Tile, values: &[Complex32]) -> Self {
        let mut white = vec![Complex64::ZERO; values.len()];
        tile.whitener.whiten(values, &mut white);
        Self { tile, white }
    }

    /// Term of a steering vector over channels and bins.
    pub(super) fn term(&self, steering: &[Complex64], scratch: &mut Scratch) -> Term {
        let white = &mut scratch.steering;
        white.resize(steering.len(), Complex64::ZERO);
        self.tile.whitener.whiten(steering, white);
        if let Some(stationary) = &self.tile.stationary {
            let part = product(stationary, white);
            for (value, direction) in white.iter_mut().zip(stationary) {
                *value -= direction * part;
            }
        }
        Term {
            filtered: product(white, &self.white),
            gain: power(white),
        }
    }

    /// Energy `x^H R^-1 x` without the part along the direction of a stationary scatterer: at least the statistic of any steering vector.
    pub(super) fn energy(&self) -> f64 {
        let stationary = self.tile.stationary.as_ref();
        power(&self.white)
            - stationary.map_or(0.0, |direction| product(direction, &self.white).norm_sqr())
    }
}
