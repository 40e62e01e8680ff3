//! Product whose image is larger than memory. Its `image.npy` is filled block by block and then read from disk; the
//! complete product is renamed into place at the end.
//!
//! ```text
//! Growing ── put (place, pixels) ──> finish ──> Grown (read part by part: picture, measures) ── write ──> the folder
//! ```

use std::path::{Path, PathBuf};

use num_complex::Complex32;
use serde_json::Value;

use super::{IMAGE, commit, finish};
use crate::atomic::WriteError;
use crate::npy::{self, Filling, ImageFile};
use crate::staging::Staged;
use crate::written::WrittenFile;
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};

/// Product being filled. Removed when dropped.
#[derive(Debug)]
pub struct PendingProduct {
    image: Filling,
    staged: Staged,
    folder: PathBuf,
}

impl PendingProduct {
    /// Begin a product with an image of these rows and columns, all zero.
    ///
    /// # Errors
    /// [`WriteError`], also if the disk has no room for the image.
    pub fn begin(folder: &Path, [rows, columns]: [usize; 2]) -> Result<Self, WriteError> {
        let bytes = npy::file_bytes((rows as u64).saturating_mul(columns as u64));
        let staged = Staged::begin(folder, bytes)?;
        staged.check(super::NAMES)?;
        let file = staged.create_open(IMAGE)?;
        let image = Filling::begin(file, [rows, columns]);
        Ok(Self {
            image: image.map_err(|source| staged.failed(IMAGE, source))?,
            staged,
            folder: folder.to_owned(),
        })
    }

    /// Write the pixels of a block, row-major.
    ///
    /// # Errors
    /// [`WriteError`].
    ///
    /// # Panics
    /// Panics if the number of pixels differs from that of the block.
    pub fn put(&mut self, place: &PixelBlock, pixels: &[Complex32]) -> Result<(), WriteError> {
        let put = self.image.put(place, pixels);
        put.map_err(|source| self.staged.failed(IMAGE, source))
    }

    /// Finish the image.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be synced or read back.
    pub fn finish(self) -> Result<CompleteProduct, WriteError> {
        let Self {
            image,
            staged,
            folder,
        } = self;
        let mut file = image.into_file();
        let about = staged.seal(IMAGE, &mut file)?;
        let image = ImageFile::of(file, &folder.join(IMAGE))
            .map_err(|error| staged.failed(IMAGE, std::io::Error::other(error)))?;
        Ok(CompleteProduct {
            image,
            about,
            staged,
        })
    }
}

/// Product with a complete image, ready to be written. Removed when dropped.
#[derive(Debug)]
pub struct CompleteProduct {
    image: ImageFile,
    /// Size and CRC-32 of the image file.
    about: Value,
    staged: Staged,
}

impl CompleteProduct {
    /// Write record and picture (the bytes of a PNG file, or empty) and rename all files into place.
    ///
    /// # Errors
    /// [`WriteError`], as [`super::Product::write`].
    ///
    /// # Panics
    /// Panics if `metadata` is not an object.
    pub fn write(self, metadata: &Value, quicklook: &[u8]) -> Result<Vec<WrittenFile>, WriteError> {
        commit(finish(self.staged, self.about, metadata, quicklook)?)
    }
}

impl ImageSource for CompleteProduct {
    fn size(&self) -> (usize, usize) {
        self.image.size()
    }

    fn places(&self) -> PixelBlocks {
        self.image.places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        self.image.window(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::{self, Product};
    use serde_json::json;
    use std::fs;
    use subaperture_model::geometry::ImageGrid;
    use subaperture_model::image::Tiling;

    #[test]
    fn pending_product_equals_product_written_at_once() {
        let grid: ImageGrid = "x=0:7:1,y=0:5:1".parse().unwrap();
        let image = Image {
            rows: 5,
            columns: 7,
            pixels: (0..35).map(|i| Complex32::new(i as f32, -0.5)).collect(),
        };
        let metadata = json!({ "grid": product::record::grid(&grid) });
        let at = tempfile::tempdir().unwrap();
        let once = at.path().join("once");
        let whole = Product {
            image: &image,
            metadata: &metadata,
            quicklook: b"picture",
        };
        whole.write(&once).unwrap();

        let grown = at.path().join("grown");
        let tiling = Tiling {
            image: [5, 7],
            tile: [2, 3],
        };
        let mut growing = PendingProduct::begin(&grown, [5, 7]).unwrap();
        for index in (0..tiling.count()).rev() {
            let place = tiling.place(index);
            growing
                .put(&place, &image.window(&place).unwrap().pixels)
                .unwrap();
        }
        assert!(!grown.exists());
        let whole = growing.finish().unwrap();
        assert_eq!(
            whole.window(&[1..4, 2..6]).unwrap(),
            image.window(&[1..4, 2..6]).unwrap()
        );
        whole.write(&metadata, b"picture").unwrap();
        for name in product::NAMES {
            let [a, b] = [&once, &grown].map(|folder| fs::read(folder.join(name)).unwrap());
            assert!(a == b, "{name}");
        }
        assert_eq!(product::read(&grown).unwrap().image, image);

        // An abandoned product leaves the existing one unchanged.
        let mut lost = PendingProduct::begin(&grown, [5, 7]).unwrap();
        lost.put(&[0..5, 0..7], &[Complex32::ONE; 35]).unwrap();
        drop(lost);
        assert_eq!(product::read(&grown).unwrap().image, image);
        assert_eq!(fs::read_dir(&grown).unwrap().count(), 3);
    }
}
