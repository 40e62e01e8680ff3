//! Receivers of formed tiles.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::Tile;
use super::sampled::TileRecord;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, copy_common};

/// Receiver of formed tiles.
pub trait Sink {
    /// Store tile `index`.
    ///
    /// # Errors
    /// Any error; it ends the work.
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>>;
}

/// Whole image in memory.
pub struct InMemory {
    /// Pixels of the whole grid.
    pub image: Image,
    /// Tile records by tile index.
    pub records: BTreeMap<usize, TileRecord>,
}

impl InMemory {
    /// Make an image of zeros.
    pub fn new(grid: &ImageGrid) -> Self {
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        Self {
            image: Image {
                rows,
                columns,
                pixels: vec![Complex32::ZERO; rows * columns],
            },
            records: BTreeMap::new(),
        }
    }
}

impl Sink for InMemory {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let image = &mut self.image;
        let whole = [0..image.rows, 0..image.columns];
        copy_common(&whole, &mut image.pixels, &tile.place.place(), &tile.pixels);
        self.records.insert(index, record);
        Ok(())
    }
}
