//! What a former forms: specification, tiles and work.

use glam::DVec3;
use num_complex::Complex32;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Weights};

use super::cost::Cost;
use super::error::FormError;
use super::former_choices::FormerChoices;
use super::numerics::Numerics;
use super::patch::{PatchSize, Rectangle};

/// Default limit on the scratch memory of one worker, bytes; available on every supported machine.
pub const SCRATCH_BYTES: u64 = 48 << 20;

/// Specification of an image: everything the image depends on except the samples and the former.
#[derive(Clone, Copy)]
pub struct ImageSpec<'a> {
    /// Geometry and frequencies of the recording.
    pub collection: &'a Collection,
    /// Pixel grid of the image.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// Limit on tables and buffers of one worker, bytes. A plan that would need more uses a different method. The smallest
    /// machine that has to carry out the plan determines it.
    pub scratch_bytes: u64,
    /// Transforms and timing model.
    pub numerics: Numerics<'a>,
}

impl<'a> ImageSpec<'a> {
    /// Specification with [`SCRATCH_BYTES`] of scratch memory and default [`Numerics`].
    pub fn new(collection: &'a Collection, grid: &'a ImageGrid, weights: &'a Weights) -> Self {
        Self {
            collection,
            grid,
            weights,
            scratch_bytes: SCRATCH_BYTES,
            numerics: Numerics::default(),
        }
    }
}

/// Plan of a former for an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision<C = FormerChoices> {
    /// Parameters chosen by the former, for [`ImageFormer::open`](super::ImageFormer::open).
    pub choices: C,
    /// Summary of the choices for people and records: a JSON object.
    pub settings: serde_json::Value,
    /// Planned relative RMS error, dB ([`super::accuracy`]).
    pub planned_db: f64,
    /// Tile grain, pixels: tiles with edges at its multiples cost least.
    pub grain: PatchSize,
    /// Operations and memory for the whole image.
    pub cost: Cost,
}

impl<C> Decision<C> {
    /// Convert the choices to another type.
    pub(crate) fn map_choices<D>(self, convert: impl FnOnce(C) -> D) -> Decision<D> {
        let Self {
            choices,
            settings,
            planned_db,
            grain,
            cost,
        } = self;
        Decision {
            choices: convert(choices),
            settings,
            planned_db,
            grain,
            cost,
        }
    }
}

/// Rectangular part of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Position in the grid.
    pub place: Rectangle,
    /// Pixels, row-major; zeros before the tile is formed.
    pub pixels: Vec<Complex32>,
}

impl Tile {
    /// Make a tile of zeros.
    pub fn new(place: Rectangle) -> Self {
        let count = place.size.rows * place.size.columns;
        Self {
            place,
            pixels: vec![Complex32::ZERO; count],
        }
    }

    /// Positions of the pixels in the scene, metres, row-major.
    pub fn points(&self, grid: &ImageGrid) -> impl Iterator<Item = DVec3> {
        let Rectangle { row, column, size } = self.place;
        let rows = row..row + size.rows;
        rows.flat_map(move |row| {
            (column..column + size.columns).map(move |column| grid.position_m(row, column))
        })
    }

    /// Make a tile of the whole grid.
    pub fn whole(grid: &ImageGrid) -> Self {
        Self::new(Self::place_of(grid))
    }

    /// Rectangle of the whole grid.
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

    /// Pixel at a row and column of the grid; `None` outside the tile.
    pub fn at(&self, row: usize, column: usize) -> Option<Complex32> {
        let place = self.place;
        if !place.contains(row, column) {
            return None;
        }
        let index = (row - place.row) * place.size.columns + column - place.column;
        Some(self.pixels[index])
    }

    /// Refuse a tile with a NaN or infinite pixel.
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

/// Source of the pulses and limits for forming tiles.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// Phase history of the recording.
    pub history: &'a dyn PhaseHistory,
    /// Memory limit, bytes, for everything except the tiles and the recording's own buffers.
    pub memory_bytes: u64,
    /// Receiver of progress and source of cancellation.
    pub monitor: &'a dyn Monitor,
}
