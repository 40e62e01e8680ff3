//! Phase gradient autofocus, on the phase history (C 6.2).
//!
//! By default ([`Estimator::Likelihood`]) the histories of all range cells are used, cut into tiles (`tiles.rs`): the phases maximise the likelihood of
//! their cross-range profiles (`texture.rs`), of points as of clutter. Residual errors, compared with a textbook PGA
//! (Wahl, Eichel, Ghiglia and Jakowatz 1994) on scenes of points, K-distributed texture and speckle, with 3 rad rms of quadratic, polynomial,
//! sinusoidal and random-walk errors (`tests/images/table.rs`), rms over 8 seeds: 0.02 to 0.08 rad, of the textbook PGA 0.2 to 1.3 rad. No other
//! method here is better on any of them. One round suffices.
//!
//! Only bright points are used where the geometry leaves too few cells to a tile (wide angles, near range), and by [`Estimator::Eigenvector`] and
//! [`Estimator::Gradient`].
//!
//! A phase error common to the scene is visible in the histories of bright points (`echoes.rs`). A round by bright points
//!
//! 1. takes the brightest pixel of every range bin of the image, and its history;
//! 2. centres each history (`centring.rs`: C's circular shift);
//! 3. applies a low pass (C's window): all in the first two rounds, because an error that changes from pulse to
//!    pulse spreads a point over the whole image, then half as much in each round;
//! 4. estimates the common phase of the histories ([`Estimator`]), each weighted by the share of its point's power (`echoes.rs`), where C
//!    uses equal weights; then again with the points centred after correction of these phases.
//!
//! **Why not on the image's spectrum.** Conventional PGA uses an azimuth transform of the image as the phase history. That
//! is valid for small far scenes and formers in the frequency domain; a backprojected image on a ground grid has a different
//! spectrum at every position (C 6.2.2, 6.3.3). Histories of points are equivalent where that is valid, and exact elsewhere: in the near
//! field, over wide angles, on any track, for images of any former on any grid.
//!
//! Neglected: the dependence of phase errors of a moving radar on the direction of the point
//! ([`ModifiedPhaseGradient`](super::ModifiedPhaseGradient)), and range errors of a cell or more.
//!
//! Each channel has its own histories. The phase of a turn is common to all channels.
//!
//! Cost of a round: one image, plus points times samples. Measured accuracy (`tests/images`): white errors of 2 rad rms are removed to
//! within 0.02 dB of a point's peak on 40 simulated points. Added to two degrees of the GOTCHA recording, they leave its brightest reflector
//! 0.1 dB above that of the original recording, which has phase errors itself. With the gradient it remains 1 dB below: with many points of
//! low signal-to-noise ratio, the errors of steps accumulate.

use glam::DVec3;
use rayon::prelude::*;

use subaperture_focus::FormError;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

use super::centring::{Centred, centre};
use super::correction::Correction;
use super::echoes::{Echo, Points, brightest, echoes};
use super::estimator::{Estimator, Row, low_pass, phases_rad};
use super::likelihood::TileRow;
use super::rounds::{Method, RoundInput, SharpenError};
use super::split::{Half, Split, bin_of};
use super::texture::estimate;
use super::tiles::tiling;

/// Least number of pulses.
const MIN_TURNS: usize = 8;

/// Number of rounds without a window, and the narrowest window, cycles over the aperture.
const OPEN_ROUNDS: usize = 2;
const MIN_CYCLES: f64 = 6.0;

/// Largest distance of a point from its pixel, resolution cells: initially a neighbouring pixel; after correction of the phases, the
/// distance to the brightest pixel of its blur.
const NEAR_CELLS: f64 = 1.5;
const FAR_CELLS: f64 = 8.0;

/// Largest number of values in all tiles, and number of tiles that are used for any number of pulses.
const MAX_VALUES: usize = 1 << 17;
const MIN_TILES: usize = 32;

/// Number of estimates with the points centred again.
const CENTRINGS: usize = 3;

/// Phase gradient autofocus: one phase per pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseGradient {
    /// Estimator of the common phases.
    pub estimator: Estimator,
    /// Selection of the bright points.
    pub points: Points,
}

impl Default for PhaseGradient {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            points: Points {
                most: 64,
                within_db: 30.0,
            },
        }
    }
}

impl Method for PhaseGradient {
    fn name(&self) -> &'static str {
        "pga"
    }

    fn first_rounds(&self, turns: usize) -> usize {
        let halvings = libm::log2(turns as f64 / MIN_CYCLES).max(0.0);
        OPEN_ROUNDS + halvings as usize
    }

    fn propose(&self, look: &RoundInput) -> Result<Option<Correction>, SharpenError> {
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let phases = match self.estimator {
            Estimator::Likelihood => match self.by_tiles(look)? {
                Tiled::Found(phases) => phases,
                Tiled::NoCorrection => return Ok(None),
                Tiled::TooFew => self.by_points(look)?,
            },
            _ => self.by_points(look)?,
        };
        let channels = collection.pulses.len() / turns;
        let error_rad = (0..channels).flat_map(|_| phases.iter().copied()).collect();
        Ok(Some(Correction::Phase { error_rad }))
    }
}

/// Outcome of estimation by tiles.
enum Tiled {
    /// Phases, one per turn.
    Found(Vec<f64>),
    /// Held-out data confirm no correction.
    NoCorrection,
    /// There are too few tiles.
    TooFew,
}

impl PhaseGradient {
    /// Phases by the likelihood of tiles; only in the first round, which starts from the uncorrected recording.
    fn by_tiles(&self, look: &RoundInput) -> Result<Tiled, SharpenError> {
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let grid = look.subject.grid;
        if turns < MIN_TURNS {
            return Ok(Tiled::TooFew);
        }
        look.room("tiles", 16 * grid.num_pixels())?;
        let Some(mut tiling) = tiling(collection, grid, look.image) else {
            return Ok(Tiled::TooFew);
        };
        let Some(split) = Split::of(collection, grid, look.image) else {
            return Ok(Tiled::TooFew);
        };
        if look.round > 0 {
            return Ok(Tiled::NoCorrection);
        }
        let channels = collection.pulses.len() / turns;
        let most = (MAX_VALUES / (turns * channels)).max(MIN_TILES);
        tiling.keep(most);
        // Complex: a row, its profile and the gradient of its cells. Real: powers, means and their slopes.
        let bytes = |tiles: usize| (22 * 8 * tiles * turns * channels) as u64;
        while tiling.tiles.len() > MIN_TILES
            && look.room("tiles", bytes(tiling.tiles.len())).is_err()
        {
            tiling.keep(tiling.tiles.len() / 2);
        }
        look.room("tiles", bytes(tiling.tiles.len()))?;
        let places: Vec<DVec3> = tiling.tiles.iter().map(|tile| tile.place_m).collect();
        let histories = echoes(look.history, &look.fast(), &places, look.subject.monitor)?;
        let mut rows: Vec<TileRow> = histories
            .into_iter()
            .filter_map(|echo| {
                let tile = tiling.tiles[echo.point];
                Some(TileRow {
                    strip: (echo.first, tile.block),
                    bin: tile.bin,
                    half: split.half(tile.bin)?,
                    on_border: split.on_border(tile.bin),
                    values: echo.values,
                })
            })
            .collect();
        rows.sort_by_key(|row| (row.strip, row.bin));
        let points = self.points_by_halves(look, &split)?;
        let monitor = look.subject.monitor;
        let found = estimate(&rows, turns, tiling.cells, points, &|| monitor.cancelled());
        if monitor.cancelled() {
            return Err(FormError::Cancelled.into());
        }
        Ok(found.map_or(Tiled::NoCorrection, Tiled::Found))
    }

    /// Phases by bright points of the even half of the range cells, of the odd one, and of all.
    fn points_by_halves(
        &self,
        look: &RoundInput,
        split: &Split,
    ) -> Result<[Vec<Vec<f64>>; 3], SharpenError> {
        let collection = look.history.collection();
        let (echoes, places) = seen(look, self.name(), self.points)?;
        let of = |half: Option<Half>| {
            let echoes: Vec<Echo> = echoes
                .iter()
                .filter(|echo| {
                    let bin = bin_of(collection, places[echo.point]);
                    half.is_none() || split.half(bin) == half
                })
                .cloned()
                .collect();
            match echoes.is_empty() {
                true => Vec::new(),
                false => vec![self.common(look, &echoes, &places)],
            }
        };
        Ok([of(Some(Half::Even)), of(Some(Half::Odd)), of(None)])
    }

    /// Phases by the histories of bright points.
    fn by_points(&self, look: &RoundInput) -> Result<Vec<f64>, SharpenError> {
        let (echoes, places) = seen(look, self.name(), self.points)?;
        Ok(self.common(look, &echoes, &places))
    }

    /// Common phase of the histories of points.
    fn common(&self, look: &RoundInput, echoes: &[Echo], places: &[DVec3]) -> Vec<f64> {
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let width = window(look.round, turns);
        let mut phases = vec![0.0; turns];
        for centring in 0..CENTRINGS {
            let (known, reach) = match centring {
                0 => (None, NEAR_CELLS),
                _ => (Some(phases.as_slice()), FAR_CELLS),
            };
            let rows: Vec<Row> =
                centred(collection, look.subject.grid, echoes, places, known, reach)
                    .into_iter()
                    .zip(echoes)
                    .map(|(centred, echo)| {
                        let mut values = centred.values;
                        low_pass(&mut values, width);
                        let weight = 1.0 / echo.signal_and_rest()[1];
                        Row { values, weight }
                    })
                    .collect();
            phases = phases_rad(self.estimator, &rows, turns);
        }
        phases
    }
}

/// Window of a round, cycles per pulse.
pub(crate) fn window(round: usize, turns: usize) -> f64 {
    let halvings = (round + 1).saturating_sub(OPEN_ROUNDS) as i32;
    (0.5f64.powi(halvings)).max(MIN_CYCLES / turns as f64)
}

/// Histories of the brightest points, and the positions of the points.
///
/// # Errors
/// [`SharpenError`]: too few pulses, too little memory, or unreadable samples.
pub(crate) fn seen(
    look: &RoundInput,
    method: &'static str,
    points: Points,
) -> Result<(Vec<Echo>, Vec<DVec3>), SharpenError> {
    let collection = look.history.collection();
    let pulses = collection.num_turns();
    if pulses < MIN_TURNS {
        return Err(SharpenError::TooShort {
            method,
            needed: MIN_TURNS,
            pulses,
        });
    }
    let places = brightest(collection, look.subject.grid, look.image, points);
    if places.is_empty() {
        return Err(SharpenError::Dark);
    }
    // Memory of each value: its history, centred history and row.
    let bytes = 3 * 16 * (places.len() * collection.pulses.len()) as u64;
    look.room("the histories of points", bytes)?;
    let fast = look.fast();
    let echoes = echoes(look.history, &fast, &places, look.subject.monitor)?;
    Ok((echoes, places))
}

/// Centre all histories on their brightest positions.
pub(crate) fn centred(
    collection: &Collection,
    grid: &ImageGrid,
    echoes: &[Echo],
    places: &[DVec3],
    phases_rad: Option<&[f64]>,
    reach_cells: f64,
) -> Vec<Centred> {
    let each = echoes.par_iter();
    each.map(|echo| {
        let place_m = places[echo.point];
        centre(collection, grid, echo, place_m, phases_rad, reach_cells)
    })
    .collect()
}
