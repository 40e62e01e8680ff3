//! Product in progress: the tiles formed so far.

use num_complex::Complex32;

use subaperture_io::tiles::TileStore;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, copy_common,
};

/// Partially formed tiled image. Pixels of tiles not yet formed are NaN.
#[derive(Debug)]
pub struct PartialImage(TileStore);

impl PartialImage {
    pub(crate) fn new(store: TileStore) -> Self {
        Self(store)
    }

    /// Tile store of the image.
    pub fn store(&self) -> &TileStore {
        &self.0
    }

    /// Convert into the tile store.
    pub fn into_store(self) -> TileStore {
        self.0
    }

    /// Number of tiles formed, and total number.
    pub fn tiles(&self) -> [usize; 2] {
        let count = self.0.tiling().count();
        let formed = (0..count).filter(|&index| self.0.has(index)).count();
        [formed, count]
    }
}

impl ImageSource for PartialImage {
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    fn places(&self) -> PixelBlocks {
        self.0.places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let tiling = self.0.tiling();
        let mut window = Image {
            rows: place[0].len(),
            columns: place[1].len(),
            pixels: vec![Complex32::new(f32::NAN, f32::NAN); place[0].len() * place[1].len()],
        };
        for index in tiling.meeting(place).filter(|&index| self.0.has(index)) {
            let tile = self.0.read(index)?;
            copy_common(place, &mut window.pixels, &tiling.place(index), &tile);
        }
        Ok(window)
    }
}
