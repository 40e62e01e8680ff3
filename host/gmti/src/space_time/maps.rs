//! Maps, covariances and geometry of all sub-CPIs, and the statistic of a motion.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Channels;
use subaperture_signal::phase::{narrow, phasor};

use super::calibration::Calibration;
use super::clean::Echo;
use super::cube::{Cube, OVERSAMPLING};
use super::geometry::{Motion, Place, SubCpiGeometry};
use super::settings::Settings;
use super::statistic::{Integrated, Scratch, Snapshot, Term};
use super::training::{SPACING, Tile, Tiles};
use crate::adaptive::widen;
use crate::alignment::Alignment;
use crate::error::GmtiError;

/// Cells on each side of a cell of one channel that are not averaged, and those beyond that are.
const GUARD_CELLS: usize = 3;
const RANGE_CELLS: usize = 16;

/// Value of a hypothesis in one sub-CPI.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Filtered {
    /// Output of the matched filter, `s^H R^-1 x`.
    pub output: Complex64,
    /// SNR of a target of 1 m^2, `s^H R^-1 s`.
    pub gain: f64,
    /// Training snapshots of the covariance.
    pub snapshots: usize,
}

/// Conditions of the statistic near a motion: the same covariances for all motions, so that the statistic is smooth.
pub(super) struct Local<'a> {
    /// Tile of each sub-CPI.
    pub(super) tiles: Vec<Option<&'a Tile>>,
    /// Echo that was removed from the samples and is added again.
    pub(super) echo: Option<&'a Echo>,
    /// Whether the place lies within the grid.
    pub(super) inside: bool,
}

/// Range-Doppler maps of all sub-CPIs and channels with their covariances.
pub struct SpaceTime {
    pub(super) cube: Cube,
    pub(super) tiles: Tiles,
    pub(super) settings: Settings,
    /// Plane of the scene.
    pub(super) grid: ImageGrid,
    pub(super) centre_m: DVec3,
    /// Sub-CPI about the middle of the aperture, the epoch of motions.
    pub(super) middle: SubCpiGeometry,
    /// Direction of the track.
    pub(super) along: DVec3,
    pub(super) speed_m_s: f64,
    pub(super) lags_s: Vec<f64>,
    pub(super) calibration: Calibration,
    /// Gain of a target in noise alone, all sub-CPIs together.
    pub(super) full_gain: f64,
    pub(super) lag_spread_s: f64,
}

impl SpaceTime {
    /// Form the maps of `channels` with their differences removed, for the scene of `grid`.
    ///
    /// # Errors
    /// [`GmtiError::Unsuited`] for settings out of range or sub-CPIs of fewer than 4 pulses; [`GmtiError::SubCpiMemory`]; [`GmtiError::Track`] for pulses of uneven spacing;
    /// [`GmtiError::Read`].
    pub fn form(
        channels: &Channels,
        alignment: &Alignment,
        calibration: &Calibration,
        grid: &ImageGrid,
        settings: &Settings,
    ) -> Result<Self, GmtiError> {
        Self::without(channels, alignment, calibration, grid, &[], settings)
    }

    /// Form the maps without targets of these motions and amplitudes.
    pub(super) fn without(
        channels: &Channels,
        alignment: &Alignment,
        calibration: &Calibration,
        grid: &ImageGrid,
        targets: &[(Motion, Complex64)],
        settings: &Settings,
    ) -> Result<Self, GmtiError> {
        settings.check()?;
        let echoes = |channel: usize| {
            let echo = |&(motion, amplitude): &(Motion, Complex64)| Echo {
                motion,
                amplitude: amplitude * calibration.factor(channel, motion.position_m),
            };
            targets.iter().map(echo).collect::<Vec<_>>()
        };
        let echoes: Vec<Vec<Echo>> = (0..channels.len()).map(echoes).collect();
        let [rows, columns] =
            [&grid.rows, &grid.columns].map(|axis| [0, axis.count / 2, axis.count - 1]);
        let corner = |i: usize| grid.position_m(rows[i / 3], columns[i % 3]);
        let corners_m: Vec<DVec3> = (0..9).map(corner).collect();
        let centre_m = corners_m[4];
        let scene = (centre_m, &corners_m[..]);
        let balances = &calibration.balances;
        let cube = Cube::form(channels, alignment, balances, &echoes, scene, settings)?;
        let tiles = Tiles::new(&cube, settings);
        let track = &channels.channel(0).collection().pulses[alignment.middle_pulses()];
        let along = track[track.len() - 1].phase_centre_m() - track[0].phase_centre_m();
        let full_gain = full_gain(&cube, &tiles);
        Ok(Self {
            full_gain,
            cube,
            tiles,
            settings: *settings,
            grid: grid.clone(),
            centre_m,
            middle: {
                let [start_m, end_m] = alignment.section_m();
                let half_m = (end_m - start_m) / settings.sub_cpis as f64 / 2.0;
                let middle_m = (start_m + end_m) / 2.0;
                let section_m = [middle_m - half_m, middle_m + half_m];
                SubCpiGeometry::new(channels, alignment, section_m, centre_m)
            },
            along: along.normalize_or_zero(),
            speed_m_s: alignment.speed_m_s(),
            lags_s: alignment.lags_s().to_vec(),
            calibration: calibration.clone(),
            lag_spread_s: alignment.lag_spread_s(),
        })
    }

    /// Statistic of a motion, integrated over all sub-CPIs.
    pub fn integrate(&self, motion: &Motion) -> Integrated {
        self.integrate_along(|time_s| motion.at(time_s))
    }

    /// Statistic of a target at `position_m(time_s)`, metres and seconds, integrated over all sub-CPIs.
    pub fn integrate_along(&self, position_m: impl Fn(f64) -> DVec3) -> Integrated {
        let mut scratch = Scratch::default();
        let mut term = |sub_cpi| {
            let (_, term) = self.snapshot_term(sub_cpi, &position_m, (None, None), &mut scratch);
            term
        };
        Integrated::of((0..self.cube.sub_cpis.len()).map(&mut term))
    }

    /// Statistic of a motion near that of `local`.
    pub(super) fn integrate_with(&self, motion: &Motion, local: &Local) -> Integrated {
        let mut scratch = Scratch::default();
        let position_m = |time_s: f64| motion.at(time_s);
        let mut term = |(sub_cpi, &tile)| {
            let context = (Some(tile), local.echo);
            let (_, term) = self.snapshot_term(sub_cpi, position_m, context, &mut scratch);
            term
        };
        Integrated::of(local.tiles.iter().enumerate().map(&mut term))
    }

    /// Value of a target at `position_m(time_s)` in one sub-CPI. `None` outside of the maps.
    pub fn in_sub_cpi(
        &self,
        sub_cpi: usize,
        position_m: impl Fn(f64) -> DVec3,
    ) -> Option<Filtered> {
        let mut scratch = Scratch::default();
        let (snapshot, term) = self.snapshot_term(sub_cpi, &position_m, (None, None), &mut scratch);
        let tile = snapshot?.tile;
        Some(Filtered {
            output: term.filtered,
            gain: term.gain,
            snapshots: tile.snapshots,
        })
    }

    /// The same maps with another number of adjacent Doppler bins.
    pub(crate) fn with_bins(self, bins: usize) -> Self {
        let settings = Settings {
            bins,
            ..self.settings
        };
        let tiles = Tiles::new(&self.cube, &settings);
        Self {
            full_gain: full_gain(&self.cube, &tiles),
            tiles,
            settings,
            ..self
        }
    }

    /// Value of a target in one sub-CPI of the first channel alone, relative to the mean power of the cells of its Doppler on both sides in range (cell-averaging CFAR): detection of targets outside
    /// of the clutter's Doppler band (exo-clutter). `None` outside of the maps, or with fewer than two cells within the ranges of the grid.
    pub fn in_first_channel(
        &self,
        sub_cpi: usize,
        position_m: impl Fn(f64) -> DVec3,
    ) -> Option<Filtered> {
        let mut place = Place::default();
        self.cube.sub_cpis[sub_cpi].place(&position_m, &mut place);
        let value = |range: f64| {
            let mut value = [Complex32::ZERO];
            let bins = [self.cube.bins(&place)[0], range];
            let inside = self.cube.interpolate(sub_cpi, bins, &mut value);
            inside.then(|| widen(value[0]))
        };
        let own = self.cube.bins(&place)[1];
        let [nearest, farthest] = self.ranges(sub_cpi);
        let cells = (1..=RANGE_CELLS).flat_map(|i| {
            let apart = ((GUARD_CELLS + i) * SPACING) as f64;
            [own - apart, own + apart]
        });
        let cells = cells.filter(|range| (nearest..=farthest).contains(range));
        let powers: Vec<f64> = cells.filter_map(value).map(|z| z.norm_sqr()).collect();
        let steering = self.steering(sub_cpi, &position_m, &place, place.path_m())[0];
        let mean = powers.iter().sum::<f64>() / powers.len() as f64;
        let output = steering.conj() * value(own)? / mean;
        (powers.len() >= 2).then(|| Filtered {
            output,
            gain: steering.norm_sqr() / mean,
            snapshots: powers.len(),
        })
    }

    /// Range bins of the nearest and farthest corner of the grid in a sub-CPI.
    fn ranges(&self, sub_cpi: usize) -> [f64; 2] {
        let mut place = Place::default();
        let ends = [&self.grid.rows, &self.grid.columns].map(|axis| axis.count - 1);
        let corners = [[0, 0], [0, ends[1]], [ends[0], 0], ends];
        let mut bin = |[row, column]: [usize; 2]| {
            let corner_m = self.grid.position_m(row, column);
            self.cube.sub_cpis[sub_cpi].place(|_| corner_m, &mut place);
            self.cube.bins(&place)[1]
        };
        let bins = corners.map(&mut bin);
        [
            bins.into_iter().fold(f64::MAX, f64::min),
            bins.into_iter().fold(f64::MIN, f64::max),
        ]
    }

    pub(super) fn wavelength_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / self.cube.band.centre_hz()
    }

    /// Snapshot and term of a target at `position_m(time_s)`, with the covariance of a tile if it is given, and with an echo added.
    pub(super) fn snapshot_term<'a>(
        &'a self,
        sub_cpi: usize,
        position_m: impl Fn(f64) -> DVec3,
        (tile, echo): (Option<Option<&'a Tile>>, Option<&Echo>),
        scratch: &mut Scratch,
    ) -> (Option<Snapshot<'a>>, Term) {
        let mut place = Place::default();
        self.cube.sub_cpis[sub_cpi].place(&position_m, &mut place);
        let add = |values: &mut [Complex32]| {
            if let Some(echo) = echo {
                self.add(echo, sub_cpi, &place, values);
            }
        };
        let tile = tile.unwrap_or_else(|| Snapshot::tile(&self.cube, &self.tiles, sub_cpi, &place));
        let snapshot =
            tile.and_then(|tile| Snapshot::at(&self.cube, tile, sub_cpi, &place, add, scratch));
        let term = snapshot.as_ref().map_or(Term::default(), |snapshot| {
            let steering = self.steering(sub_cpi, &position_m, &place, place.path_m());
            snapshot.term(&self.tiles.over_bins(&steering), scratch)
        });
        (snapshot, term)
    }

    /// Values of the channels at a relative path, metres, for a target of amplitude 1 at a place of a sub-CPI.
    fn steering(
        &self,
        sub_cpi: usize,
        position_m: impl Fn(f64) -> DVec3,
        place: &Place,
        path_m: f64,
    ) -> Vec<Complex64> {
        let at_m = position_m(self.cube.sub_cpis[sub_cpi].time_s());
        let paths_m = place.paths_m.iter().enumerate();
        let element = |(channel, own_m): (usize, &f64)| {
            self.range_response(path_m - own_m)
                * phasor(-own_m / self.wavelength_m())
                * self.calibration.factor(channel, at_m)
        };
        paths_m.map(element).collect()
    }

    /// Response over range at a path beyond that of a target, metres.
    fn range_response(&self, apart_m: f64) -> Complex64 {
        let cells = apart_m / self.cube.axes.path_step_m / OVERSAMPLING as f64;
        // The middle of the band is half a sample below its reference.
        let turn = phasor(-0.5 * cells / self.cube.band.count as f64);
        let [_, range] = self.tiles.lobes();
        turn * range.at(cells)
    }

    /// Add an echo to the values of a snapshot at a place.
    fn add(&self, echo: &Echo, sub_cpi: usize, place: &Place, values: &mut [Complex32]) {
        let mut own = Place::default();
        let position_m = |time_s: f64| echo.motion.at(time_s);
        self.cube.sub_cpis[sub_cpi].place(position_m, &mut own);
        let amplitudes = self.steering(sub_cpi, position_m, &own, place.path_m());
        let apart = self.cube.doppler_bin(place.slope) - self.cube.doppler_bin(own.slope);
        let [doppler, _] = self.tiles.lobes();
        let half = (self.settings.bins / 2) as f64;
        for (j, values) in values.chunks_exact_mut(amplitudes.len()).enumerate() {
            let response = doppler.at(apart / OVERSAMPLING as f64 + j as f64 - half);
            for (value, amplitude) in values.iter_mut().zip(&amplitudes) {
                *value += narrow(echo.amplitude * amplitude * response);
            }
        }
    }
}

/// Largest gain of a steering vector of equal channels over some tiles of the middle sub-CPI, times the number of sub-CPIs.
fn full_gain(cube: &Cube, tiles: &Tiles) -> f64 {
    const TILES: usize = 16;
    let steering = tiles.over_bins(&vec![Complex64::ONE; cube.channels()]);
    let count = cube.sub_cpis.len();
    let places = (0..TILES * TILES).map(|i| {
        let place = |i: usize, count: usize| (2 * i + 1) * count / (2 * TILES);
        [
            place(i / TILES, cube.axes.dopplers),
            place(i % TILES, cube.axes.ranges),
        ]
    });
    let gain = |cell| {
        let tile = tiles.tile(cube, count / 2, cell)?;
        Some(tile.whitener.quadratic_form(&steering, &steering).re)
    };
    places.filter_map(gain).fold(0.0, f64::max) * count as f64
}
