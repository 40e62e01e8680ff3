//! Covariance of clutter and noise in tiles of range-Doppler maps.
//!
//! A snapshot has the values of all channels at the Doppler bin of a cell and at its neighbours one resolution cell apart (extended factored algorithm, EFA:
//! Ward, TR-1015, 1994). The cells around a tile, beyond guard cells, train its covariance; they are taken at the spacing of independent samples.
//!
//! A stationary scatterer has the same value in all channels after balance. Its direction `g` in the snapshot is estimated from the training cells, so that errors
//! of the balance and of the array's orientation do not matter. In a tile dominated by clutter it is removed from steering vectors, as in the channel differences of
//! [`crate::detection`]: bright stationary scatterers are no targets there.

use std::sync::OnceLock;

use num_complex::{Complex32, Complex64};
use subaperture_signal::window::Window;

use super::cube::{Axes, Cube, OVERSAMPLING};
use super::settings::{Settings, Training};
use crate::adaptive::{Covariance, Loading, Whitener, power, widen};

/// Edge of a tile, map cells.
const TILE: usize = 8;

/// Spacing of independent cells of a map, by the windows' correlation length.
pub(super) const SPACING: usize = OVERSAMPLING + 1;

/// Coherence of the channels in training cells from which clutter dominates a tile.
const CLUTTER: f64 = 0.5;

/// Covariance of a tile.
pub(super) struct Tile {
    /// Cholesky factor of the covariance of a snapshot.
    pub(super) whitener: Whitener,
    /// Number of training snapshots `K`.
    pub(super) snapshots: usize,
    /// Whitened direction of a stationary scatterer, of norm 1, where clutter dominates.
    pub(super) stationary: Option<Vec<Complex64>>,
}

/// Response of a window to a scatterer: `sum_u w(u) cos(2 pi d u) / sum_u w(u)` at `d` resolution cells from it, by linear interpolation of a table: the error is
/// below 1e-4 of the peak.
pub(super) struct Response {
    table: Vec<f64>,
}

/// Points of a window, and points of the table of a response per resolution cell and its extent in cells.
const POINTS: usize = 64;
const PER_CELL: f64 = 64.0;
const CELLS: usize = 16;

impl Response {
    fn new(window: Window) -> Self {
        let weights = window.weights(POINTS);
        let sum: f64 = weights.iter().sum();
        let u = |i: usize| (i as f64 + 0.5) / POINTS as f64 - 0.5;
        let at = |place: usize| {
            let cells = place as f64 / PER_CELL;
            let terms = weights.iter().enumerate();
            let terms = terms.map(|(i, w)| w * libm::cos(std::f64::consts::TAU * cells * u(i)));
            terms.sum::<f64>() / sum
        };
        Self {
            table: (0..CELLS * PER_CELL as usize).map(at).collect(),
        }
    }

    /// Response at a distance in resolution cells; 0 beyond the table.
    pub(super) fn at(&self, cells: f64) -> f64 {
        let place = cells.abs() * PER_CELL;
        match self
            .table
            .get(place as usize..(place as usize).saturating_add(2))
        {
            Some(&[below, above]) => below + (above - below) * place.fract(),
            _ => 0.0,
        }
    }
}

/// Tiles of all sub-CPIs, trained at first use.
pub(super) struct Tiles {
    channels: usize,
    settings: Settings,
    /// Response of the Doppler window to a scatterer at each bin of the snapshot.
    responses: Vec<f64>,
    lobes: [Response; 2],
    size: [usize; 2],
    tiles: Vec<OnceLock<Option<Tile>>>,
}

impl Tiles {
    pub(super) fn new(cube: &Cube, settings: &Settings) -> Self {
        let size = [cube.axes.dopplers, cube.axes.ranges].map(|count| count.div_ceil(TILE));
        let tiles = (0..cube.sub_cpis.len() * size[0] * size[1]).map(|_| OnceLock::new());
        let half = (settings.bins / 2) as i64;
        let [range, doppler] = settings.windows.map(Response::new);
        Self {
            channels: cube.channels(),
            settings: *settings,
            responses: (-half..=half).map(|j| doppler.at(j as f64)).collect(),
            lobes: [doppler, range],
            size,
            tiles: tiles.collect(),
        }
    }

    /// Responses over Doppler and range.
    pub(super) fn lobes(&self) -> &[Response; 2] {
        &self.lobes
    }

    /// Degrees of freedom: channels times bins.
    pub(super) fn degrees_of_freedom(&self) -> usize {
        self.channels * self.settings.bins
    }

    /// Tile of a cell. `None` if too few training cells are in the map.
    pub(super) fn tile(
        &self,
        cube: &Cube,
        sub_cpi: usize,
        [doppler, range]: [usize; 2],
    ) -> Option<&Tile> {
        let [rows, columns] = self.size;
        let (row, column) = (doppler / TILE, range / TILE);
        let tile = &self.tiles[(sub_cpi * rows + row) * columns + column];
        tile.get_or_init(|| self.train(cube, sub_cpi, [row * TILE, column * TILE]))
            .as_ref()
    }

    fn train(&self, cube: &Cube, sub_cpi: usize, first: [usize; 2]) -> Option<Tile> {
        let channels = self.channels;
        let size = self.degrees_of_freedom();
        let half = self.settings.bins / 2 * OVERSAMPLING;
        let Axes {
            dopplers, ranges, ..
        } = cube.axes;
        let inner = self.settings.guard_cells * SPACING;
        let outer = inner + self.settings.training_cells * SPACING;
        // Snapshots of cells within a bin of the edge are incomplete.
        let axis = |first: usize, count: usize, margin: usize| {
            let from = first.saturating_sub(outer + margin).max(margin);
            let to = (first + TILE + outer + margin).min(count.saturating_sub(margin));
            (from..to).step_by(SPACING)
        };
        let guarded = |at: usize, first: usize, margin: usize| {
            at + inner + margin >= first && at < first + TILE + inner + margin
        };
        let mut snapshots: Vec<Vec<Complex32>> = Vec::new();
        for doppler in axis(first[0], dopplers, half) {
            for range in axis(first[1], ranges, 0) {
                if guarded(doppler, first[0], half) && guarded(range, first[1], 0) {
                    continue;
                }
                let mut snapshot = vec![Complex32::ZERO; size];
                for (j, values) in snapshot.chunks_exact_mut(channels).enumerate() {
                    let bin = doppler + j * OVERSAMPLING - half;
                    cube.cell(sub_cpi, [bin, range], values);
                }
                snapshots.push(snapshot);
            }
        }
        if self.settings.training == Training::Strongest {
            let strength = |snapshot: &Vec<Complex32>| -> f32 {
                snapshot.iter().map(Complex32::norm_sqr).sum()
            };
            snapshots.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
            snapshots.truncate(snapshots.len().div_ceil(2));
        }
        let count = snapshots.len();
        if count < 2 * size {
            return None;
        }
        let mut covariance = Covariance::new(size);
        let scale = (count as f32).sqrt().recip();
        let middle = self.settings.bins / 2 * channels;
        let mut cross = vec![Complex64::ZERO; channels];
        let mut powers = vec![0.0; channels];
        for snapshot in &mut snapshots {
            for (c, value) in snapshot[middle..middle + channels].iter().enumerate() {
                cross[c] += widen(*value) * widen(snapshot[middle]).conj();
                powers[c] += f64::from(value.norm_sqr());
            }
            snapshot.iter_mut().for_each(|z| *z *= scale);
            covariance.add(snapshot);
        }
        let whitener = covariance.factor(Loading::Off).ok()?;
        let coherences = (1..channels).map(|c| cross[c].norm() / (powers[0] * powers[c]).sqrt());
        let coherence = coherences.sum::<f64>() / (channels - 1) as f64;
        let stationary = (coherence > CLUTTER).then(|| {
            let gains = cross.iter().map(|cross| cross / powers[0]);
            let gains: Vec<Complex64> = gains.collect();
            let vector = self.over_bins(&gains);
            let mut white = vec![Complex64::ZERO; size];
            whitener.whiten(&vector, &mut white);
            let norm = power(&white).sqrt();
            white.iter_mut().for_each(|value| *value /= norm);
            white
        });
        Some(Tile {
            whitener,
            snapshots: count,
            stationary,
        })
    }

    /// Steering vector over channels and bins from that over channels.
    pub(super) fn over_bins(&self, channels: &[Complex64]) -> Vec<Complex64> {
        let bins = self.responses.iter();
        bins.flat_map(|&response| channels.iter().map(move |value| value * response))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use subaperture_model::phase_history::Collection;
    use subaperture_simulate::scenario::{Scenario, examples};

    use super::*;
    use crate::adaptive::mean_sinr_loss;
    use crate::alignment::Alignment;
    use crate::balance::balance;
    use crate::space_time::{Calibration, SpaceTime};

    /// Loss of filters from `K = 2 N` cells against the covariance of all cells of the scene's ranges and Dopplers.
    #[test]
    fn filters_of_few_cells_lose_sinr_as_by_theory() {
        let text = examples::text("gmti").unwrap();
        let mut scenario = Scenario::new("gmti.toml", text, ".");
        for mover in 0..3 {
            let key = format!("scene.mover[{mover}].cross_section");
            scenario.set(&key, "1e-9 m^2").unwrap();
        }
        let experiment = scenario.experiment().unwrap();
        let channels = experiment.channels(1 << 30).unwrap();
        let collections: Vec<&Collection> = channels.iter().map(|(_, h)| h.collection()).collect();
        let alignment = Alignment::new(&collections).unwrap();
        let calibration = Calibration {
            balances: balance(&channels, &alignment, DVec3::ZERO).unwrap(),
            models: Vec::new(),
            view: None,
        };
        let grid = "x=-50:50:1,y=-50:50:1".parse().unwrap();
        let settings = Settings::default();
        let maps = SpaceTime::form(&channels, &alignment, &calibration, &grid, &settings).unwrap();
        let cube = &maps.cube;
        let size = cube.channels();
        let middle = settings.sub_cpis / 2;
        let rows = cube.axes.zero_doppler - 2..cube.axes.zero_doppler + 3;
        // Independent cells of the scene, 100 m of range about its centre.
        let centre = (-cube.axes.first_range) as usize;
        let cells = || {
            let columns = (centre - 90..centre + 90).step_by(SPACING);
            rows.clone()
                .step_by(SPACING)
                .flat_map(move |row| columns.clone().map(move |column| [row, column]))
        };
        let mut values = vec![Complex32::ZERO; size];
        let mut snapshots = Vec::new();
        for cell in cells() {
            cube.cell(middle, cell, &mut values);
            snapshots.push(values.clone());
        }
        let factor = |snapshots: &[Vec<Complex32>]| {
            let scale = (snapshots.len() as f32).sqrt().recip();
            let mut covariance = Covariance::new(size);
            for snapshot in snapshots {
                let scaled: Vec<Complex32> = snapshot.iter().map(|z| z * scale).collect();
                covariance.add(&scaled);
            }
            covariance.factor(Loading::Off).unwrap()
        };
        let known = factor(&snapshots);
        let lags_s = alignment.lags_s();
        for velocity_m_s in [0.2, 1.0, 5.0] {
            let steering = crate::detection::steering(lags_s, 10e9, velocity_m_s);
            let few = snapshots.chunks_exact(2 * size);
            let count = few.len() as f64;
            let loss = few
                .map(|few| factor(few).sinr_loss(&steering, &known))
                .sum::<f64>()
                / count;
            let [loss_db, mean_db] =
                [loss, mean_sinr_loss(size, 2 * size)].map(|loss| 10.0 * loss.log10());
            println!(
                "{velocity_m_s} m/s, {count} filters: {loss_db:.2} dB, {mean_db:.2} dB by theory"
            );
            // A loss of beta distribution has a standard deviation of 0.15; twenty filters have 0.25 dB.
            assert!(
                loss_db > -3.0 && (loss_db - mean_db).abs() < 0.8,
                "{loss_db}"
            );
        }
    }
}
