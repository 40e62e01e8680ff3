//! What an image former is: it decides how an image will be formed, and then forms any part of it.
//!
//! ```text
//! Aim (geometry, grid, weights, scratch) ── decide ──> Decision (choices, planned error)
//! Aim, choices ── open ──> Forming ── form (pulses, tiles, memory) ──> pixels of these tiles
//! ```
//!
//! **The bits of a pixel** follow from the aim, the choices and the samples, and from nothing else: not from threads, not
//! from memory, not from which tiles are formed, where, in what order or how many at a time; and, where the aim's transforms are
//! portable, not from the machine ([`super::Transforms`]). So
//! - whatever bears on a sum's order or on a table's size is a choice, made for the whole grid, and recorded;
//! - memory decides only how many pulses are read at a time, how many threads work and how many tiles share a pass over
//!   the pulses.
//!
//! Choices are JSON, so that another process, on another machine, opens the same plan again.

use glam::DVec3;
use num_complex::Complex32;

use super::accuracy::{self, Asked, Misses};
use super::cost::Cost;
use super::patch::{PatchSize, Rectangle};
use super::{FormError, Formed, Means, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Weights};

/// Bytes that a worker's scratch may take unless told otherwise: what a plan may count on everywhere.
pub const SCRATCH_BYTES: u64 = 48 << 20;

/// What is to be formed: all on which an image depends, samples and the former itself apart.
#[derive(Clone, Copy)]
pub struct Aim<'a> {
    /// Geometry and frequencies.
    pub collection: &'a Collection,
    /// The pixels.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// Bytes that tables and one worker's buffers may take: a plan that wants more takes another way. The smallest
    /// machine that is to carry it out sets it.
    pub scratch_bytes: u64,
    /// By what means.
    pub means: Means<'a>,
}

/// How an image will be formed.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// Everything that was chosen: JSON, for [`ImageFormer::open`].
    pub choices: serde_json::Value,
    /// The same in short, for people and records: a JSON object.
    pub settings: serde_json::Value,
    /// Planned relative RMS error, dB ([`super::accuracy`]).
    pub planned_db: f64,
    /// Tiles whose edges lie at multiples of this cost least.
    pub grain: PatchSize,
    /// What the image takes.
    pub cost: Cost,
}

/// A part of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its place in the grid.
    pub place: Rectangle,
    /// Its pixels, row-major: zeros before it is formed.
    pub pixels: Vec<Complex32>,
}

impl Tile {
    /// A tile of zeros.
    pub fn new(place: Rectangle) -> Self {
        let count = place.size.rows * place.size.columns;
        Self {
            place,
            pixels: vec![Complex32::ZERO; count],
        }
    }

    /// Where its pixels lie in the scene, row-major.
    pub fn points(&self, grid: &ImageGrid) -> impl Iterator<Item = DVec3> {
        let Rectangle { row, column, size } = self.place;
        let rows = row..row + size.rows;
        rows.flat_map(move |row| {
            (column..column + size.columns).map(move |column| grid.position_m(row, column))
        })
    }

    /// All of a grid.
    pub fn whole(grid: &ImageGrid) -> Self {
        Self::new(Self::place_of(grid))
    }

    /// The place of all of a grid.
    pub fn place_of(grid: &ImageGrid) -> Rectangle {
        Rectangle {
            row: 0,
            column: 0,
            size: PatchSize {
                rows: grid.rows.count,
                columns: grid.columns.count,
            },
        }
    }

    /// The pixel at a row and column of the grid, if it is in the tile.
    pub fn at(&self, row: usize, column: usize) -> Option<Complex32> {
        let place = self.place;
        if !place.contains(row, column) {
            return None;
        }
        let index = (row - place.row) * place.size.columns + column - place.column;
        Some(self.pixels[index])
    }

    /// Refuses a tile with a pixel that is NaN or infinite.
    ///
    /// # Errors
    /// [`FormError::NotFinite`].
    pub fn check_finite(&self, grid: &ImageGrid) -> Result<(), FormError> {
        let finite = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        match self.pixels.iter().position(|z| !finite(z)) {
            None => Ok(()),
            Some(i) => {
                let columns = self.place.size.columns;
                let (row, column) = (
                    self.place.row + i / columns,
                    self.place.column + i % columns,
                );
                Err(FormError::NotFinite {
                    row,
                    column,
                    position_m: grid.position_m(row, column).to_array(),
                })
            }
        }
    }
}

/// What tiles are formed from, and within.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// Where the pulses come from.
    pub history: &'a dyn PhaseHistory,
    /// Bytes for everything beside the tiles and what the recording holds.
    pub memory_bytes: u64,
    /// Told of progress, asked whether to go on.
    pub monitor: &'a dyn Monitor,
}

/// A former that is ready to form tiles of one image.
pub trait Forming: Sync {
    /// Bytes a pixel that forming takes beside the 8 of the tile.
    fn pixel_bytes(&self) -> u64 {
        0
    }

    /// Adds the image to tiles of zeros, in one pass over the pulses.
    ///
    /// # Errors
    /// [`FormError`]; the tiles are then worth nothing.
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError>;
}

/// An algorithm that forms images.
pub trait ImageFormer: Send + Sync {
    /// The name used in records and on the command line.
    fn name(&self) -> &'static str;

    /// What it was told: JSON from which [`super::formers::former`] makes it again.
    fn settings(&self) -> serde_json::Value;

    /// The bound that its images are to keep ([`accuracy`]), dB; `None` if it has none.
    fn bound_db(&self) -> Option<f64>;

    /// Whether it takes each sample at its own moment, where antennas move while a pulse lasts. If not, what
    /// that leaves ([`super::sweep::residual`]) is part of the planned error.
    fn follows_sweeps(&self) -> bool {
        false
    }

    /// Whether it forms pixels that lie on a surface over the grid's plane ([`ImageGrid::relief`]) within its bound. A task whose grid has
    /// one is refused if not.
    fn follows_relief(&self) -> bool {
        false
    }

    /// The bound, and what to do where it is missed.
    fn asked(&self, misses: Misses) -> Asked {
        Asked {
            bound_db: self.bound_db(),
            misses,
        }
    }

    /// Decides how the image of `aim` will be formed, once `asked` has agreed to the error that this means.
    ///
    /// # Errors
    /// [`FormError`].
    fn decide(
        &self,
        aim: &Aim,
        asked: &Asked,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError>;

    /// Makes ready to form the image of `aim` as [`Self::decide`] decided, here or elsewhere.
    ///
    /// # Errors
    /// [`FormError::Choices`] if `choices` are not of this former and this aim.
    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError>;

    /// Forms the image of `task` within the bound.
    ///
    /// # Errors
    /// [`FormError`].
    fn form(&self, task: &Task) -> Result<Formed, FormError> {
        self.form_asked(task, Misses::Refused)
    }

    /// Forms the image of `task` as well as can be: a bound that is missed is noted in
    /// [`Formed::bound_missed`].
    ///
    /// # Errors
    /// [`FormError`], [`FormError::BoundMissed`] never.
    fn form_best(&self, task: &Task) -> Result<Formed, FormError> {
        self.form_asked(task, Misses::Allowed)
    }

    /// Forms the image of `task` as planned, and does not compare it with the exact sum: for the many images of a search, of
    /// which the one that is found is formed again.
    ///
    /// # Errors
    /// [`FormError`], [`FormError::BoundMissed`] never.
    fn form_planned(&self, task: &Task) -> Result<Formed, FormError> {
        accuracy::keep_planned(self, task, Misses::Allowed)
    }

    /// [`Self::form`] or [`Self::form_best`].
    ///
    /// # Errors
    /// [`FormError`].
    fn form_asked(&self, task: &Task, misses: Misses) -> Result<Formed, FormError> {
        accuracy::keep_replanning(self, task, misses)
    }

    /// The same former, planning for an error of `error_db`; `None` if it has no way to make its errors smaller.
    fn planning_for(&self, _error_db: f64) -> Option<Box<dyn ImageFormer>> {
        None
    }
}

/// `choices` as what a former chooses.
///
/// # Errors
/// [`FormError::Choices`].
pub(crate) fn chosen<T: serde::de::DeserializeOwned>(
    former: &'static str,
    choices: &serde_json::Value,
) -> Result<T, FormError> {
    T::deserialize(choices).map_err(|error| misfit(former, &error.to_string()))
}

/// The refusal of choices that this former never made for this aim.
pub(crate) fn misfit(former: &'static str, what: &str) -> FormError {
    FormError::Choices {
        former,
        what: what.to_owned(),
    }
}
