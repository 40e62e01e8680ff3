//! Images as they are stored: a product, by its folder or its `image.json`, an array alone, or anyone's SICD.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde::Deserialize;
use serde_json::Value;
use subaperture::geometry::ImageGrid;
use subaperture::image::Parts;
use subaperture::io::npy::ImageFile;
use subaperture::io::product;
use subaperture::quality::aperture::Aperture;
use subaperture::quality::response::Geometry;
use subaperture::sicd::{Plane, SicdFile};
use subaperture::signal::window::Window;

/// An image, and what is stored beside it.
pub(super) struct Stored {
    pub(super) path: PathBuf,
    /// In its files.
    pub(super) pixels: Box<dyn Parts>,
    /// Grid and record of a product.
    pub(super) product: Option<(ImageGrid, Value)>,
    /// Where the pixels of a SICD are.
    pub(super) plane: Option<Plane>,
}

/// Weights along an aperture that tell how bright its parts are.
const WEIGHTS: usize = 256;

/// By which frequencies parts of a product's aperture are told, of its record.
pub(super) fn aperture(record: &Value, grid: &ImageGrid) -> Option<Aperture> {
    let seen = Geometry::deserialize(&record["collection"]).ok()?;
    let window = record["settings"]["slow_window"].as_str();
    let window: Option<Window> = window.and_then(|text| text.parse().ok());
    let weights = window.map_or_else(Vec::new, |window| window.weights(WEIGHTS));
    Aperture::seen(&seen, grid).map(|aperture| aperture.weighted(weights))
}

/// The folder of the product that a path names: itself, or that of its `image.json`.
pub(super) fn product_folder(path: &Path) -> Option<&Path> {
    if path.is_dir() {
        return Some(path);
    }
    let is_record = path.file_name().is_some_and(|name| name == "image.json");
    let folder = path.parent().filter(|_| is_record)?;
    Some(match folder == Path::new("") {
        true => Path::new("."),
        false => folder,
    })
}

/// Opens a product, a complex64 `.npy` or a SICD.
pub(super) fn open(path: &Path) -> anyhow::Result<Stored> {
    let path = path.to_owned();
    if let Some(folder) = product_folder(&path) {
        if is_velocity_plane(folder) {
            return Ok(Stored {
                pixels: Box::new(ImageFile::open(&folder.join("image.npy"))?),
                product: None,
                plane: None,
                path,
            });
        }
        let stored = product::open(folder)?;
        return Ok(Stored {
            pixels: Box::new(stored.pixels),
            product: Some((stored.grid, stored.metadata)),
            plane: None,
            path,
        });
    }
    if is_nitf(&path) {
        let file = SicdFile::open(&path)?;
        return Ok(Stored {
            product: None,
            plane: file.plane(),
            pixels: Box::new(file),
            path,
        });
    }
    check_is_array(&path)?;
    let file = ImageFile::open(&path)?;
    if file.size().0 * file.size().1 == 0 {
        bail!("{}: an image without pixels", path.display());
    }
    Ok(Stored {
        pixels: Box::new(file),
        product: None,
        plane: None,
        path,
    })
}

/// Whether a folder is of `subap velocity`, whose axes are no places.
pub(super) fn is_velocity_plane(folder: &Path) -> bool {
    // What cannot be read is told by who reads it next.
    let record = fs::read(folder.join("image.json")).unwrap_or_default();
    let record: Value = serde_json::from_slice(&record).unwrap_or_default();
    record["schema"] == "subaperture-velocity-plane"
}

/// Refuses a file that is no array, such as a recording, with a word about what is wanted.
pub(super) fn check_is_array(path: &Path) -> anyhow::Result<()> {
    // What cannot be opened is told by who reads it next.
    if path.is_file() && !begins_with(path, b"\x93NUMPY") {
        bail!(
            "{}: no image: give the folder of a product (with image.json and image.npy), a complex64 array (.npy) or a SICD",
            path.display()
        );
    }
    Ok(())
}

/// Whether a file is NITF, as SICD is.
pub(super) fn is_nitf(path: &Path) -> bool {
    begins_with(path, b"NITF") || begins_with(path, b"NSIF")
}

/// Whether a file that can be read begins with these bytes.
pub(super) fn begins_with<const N: usize>(path: &Path, bytes: &[u8; N]) -> bool {
    let mut start = [0; N];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && &start == bytes
}

impl Stored {
    /// Refuses two products whose pixels are not the same places: their difference would say nothing.
    pub(super) fn check_same_grid(&self, other: &Self) -> anyhow::Result<()> {
        if let (Some((grid, _)), Some((others, _))) = (&self.product, &other.product)
            && grid != others
        {
            bail!(
                "{} and {} are on different grids: form both with one --grid",
                self.path.display(),
                other.path.display()
            );
        }
        Ok(())
    }
}
