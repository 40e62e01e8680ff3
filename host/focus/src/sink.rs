//! Receivers of formed tiles.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::sampled::TileRecord;
use super::{Plan, Tile};
use subaperture_model::image::{Image, ImageSource, ImageSourceError, copy_common};

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
    ) -> Result<(), ImageSourceError>;
}

/// Receiver of a whole image: an array in memory, a file, or a store that several processes fill.
pub trait ImageSink: Sink {
    /// Prepare for the image of `plan`, and return the indices of the tiles to form, ascending. A second plan replaces all tiles of the first.
    ///
    /// # Errors
    /// Any error; it ends the work.
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, ImageSourceError>;

    /// Maximum number of tiles formed in one pass over the pulses. Default: as many as the memory allows.
    fn max_tiles_a_pass(&self, _plan: &Plan) -> usize {
        usize::MAX
    }

    /// Records of all tiles by index; `None` while tiles are missing.
    ///
    /// # Errors
    /// Any error; it ends the work.
    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, ImageSourceError>;

    /// Complete image, if it can be read back. Needed only to compare every pixel of a small image.
    fn image(&self) -> Option<&dyn ImageSource> {
        None
    }
}

/// Whole image in memory.
#[derive(Debug)]
pub struct InMemory {
    /// Pixels of the whole grid.
    pub image: Image,
    /// Tile records by tile index.
    pub records: BTreeMap<usize, TileRecord>,
    num_tiles: usize,
}

impl InMemory {
    /// Make a sink without an image; [`ImageSink::begin`] makes the image.
    #[expect(clippy::new_without_default, reason = "a sink is no value")]
    pub fn new() -> Self {
        Self {
            image: Image {
                rows: 0,
                columns: 0,
                pixels: Vec::new(),
            },
            records: BTreeMap::new(),
            num_tiles: 0,
        }
    }

    /// Make an image of zeros for `plan`.
    pub fn of(plan: &Plan) -> Self {
        let mut sink = Self::new();
        sink.reset(plan);
        sink
    }

    fn reset(&mut self, plan: &Plan) {
        let [rows, columns] = plan.tiling().image;
        self.num_tiles = plan.num_tiles();
        // A single tile brings its own pixels.
        let pixels = if self.num_tiles > 1 {
            rows * columns
        } else {
            0
        };
        self.image.pixels = Vec::new();
        self.image = Image {
            rows,
            columns,
            pixels: vec![Complex32::ZERO; pixels],
        };
        self.records.clear();
    }
}

impl Sink for InMemory {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), ImageSourceError> {
        let image = &mut self.image;
        if self.num_tiles == 1 {
            image.pixels = tile.pixels;
        } else {
            let whole = [0..image.rows, 0..image.columns];
            copy_common(&whole, &mut image.pixels, &tile.place.place(), &tile.pixels);
        }
        self.records.insert(index, record);
        Ok(())
    }
}

impl ImageSink for InMemory {
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, ImageSourceError> {
        self.reset(plan);
        Ok((0..self.num_tiles).collect())
    }

    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, ImageSourceError> {
        let is_whole = self.records.len() == self.num_tiles;
        Ok(is_whole.then(|| self.records.values().cloned().collect()))
    }

    fn image(&self) -> Option<&dyn ImageSource> {
        Some(&self.image)
    }
}
