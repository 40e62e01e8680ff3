//! Reader of products: image, grid and metadata, checked to belong together.

use std::fs::File;
use std::io::{self, Seek};
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::{IMAGE, METADATA};
use crate::input::{Stamp, checksum, open_file};
use crate::json::{self, JsonError, Limits};
use crate::npy::ImageFile;
use crate::tiles::{self, StoreError, TileStore};
use subaperture_model::geometry::{Axis, ImageGrid, Relief};
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};
use subaperture_model::phase_history;

/// Limits on `image.json`: some kilobytes for a plane; a surface is one string of up to 3.5 MB.
pub const RECORD_LIMITS: Limits = Limits {
    bytes: 4 << 20,
    string_bytes: 4 << 20,
    value_bytes: 5 << 20,
};

/// Product read into memory.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StoredProduct {
    /// Image.
    pub image: Image,
    /// Grid of the image.
    pub grid: ImageGrid,
    /// Content of `image.json`.
    pub metadata: Value,
}

/// Product with its pixels on disk.
#[derive(Debug)]
pub struct OpenProduct {
    /// Image.
    pub pixels: Pixels,
    /// Grid of the image.
    pub grid: ImageGrid,
    /// Content of `image.json`.
    pub metadata: Value,
}

/// Image on disk.
#[derive(Debug)]
pub enum Pixels {
    /// Single array.
    Array(ImageFile),
    /// Tiles.
    Tiles(TileStore),
}

impl Pixels {
    /// Read the whole image.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn read(&self) -> Result<Image, ReadError> {
        match self {
            Self::Array(file) => Ok(file.read()?),
            Self::Tiles(store) => {
                let (rows, columns) = store.size();
                Ok(store.part(&[0..rows, 0..columns])?)
            }
        }
    }

    fn parts(&self) -> &dyn ImageSource {
        match self {
            Self::Array(file) => file,
            Self::Tiles(store) => store,
        }
    }
}

impl ImageSource for Pixels {
    fn size(&self) -> (usize, usize) {
        self.parts().size()
    }

    fn places(&self) -> PixelBlocks {
        self.parts().places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        self.parts().window(place)
    }
}

/// Reason why a product was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system reported an error.
    #[error("cannot read {}: {source}{}", path.display(), advice(source))]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// `image.json` does not belong to a product.
    #[error("{}: {what}", path.display())]
    Metadata {
        /// Path of the file.
        path: PathBuf,
        /// Description of the fault.
        what: String,
    },
    /// The image differs from the one described by the metadata.
    #[error("{}: {what}: it is not the image described by {METADATA}; form it again", path.display())]
    Changed {
        /// Path of the image file.
        path: PathBuf,
        /// Difference found.
        what: String,
    },
    /// The image is damaged.
    #[error(transparent)]
    Npy(#[from] phase_history::ReadError),
    /// A tile of the image is damaged.
    #[error(transparent)]
    Tiles(#[from] StoreError),
}

fn advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::NotFound => "; a product is a folder with image.json and image.npy",
        _ => "",
    }
}

/// Read a folder written by [`super::Product::write`], whose metadata contain a grid.
///
/// # Errors
/// [`ReadError`], also if the size or CRC-32 of the image differs from the metadata.
pub fn read(folder: &Path) -> Result<StoredProduct, ReadError> {
    let OpenProduct {
        pixels,
        grid,
        metadata,
    } = open(folder)?;
    Ok(StoredProduct {
        image: pixels.read()?,
        grid,
        metadata,
    })
}

/// Open such a folder and leave the pixels on disk.
///
/// # Errors
/// As [`read`]; size and CRC-32 of tiles are checked when they are read.
pub fn open(folder: &Path) -> Result<OpenProduct, ReadError> {
    open_how(folder, true)
}

/// Like [`open`], without reading the pixels of an array, so that the time does not depend on its size. [`verify`]
/// completes the check.
///
/// # Errors
/// As [`open`], except for an array's CRC-32.
pub fn open_unread(folder: &Path) -> Result<OpenProduct, ReadError> {
    open_how(folder, false)
}

/// Read a whole array of a product opened by [`open_unread`] and check its size and CRC-32. Does nothing for tiles.
///
/// # Errors
/// [`ReadError`] if they differ from the metadata.
pub fn verify(folder: &Path, metadata: &Value) -> Result<(), ReadError> {
    match metadata["files"][tiles::NAME].is_null() {
        true => open_image(folder, metadata, true).map(drop),
        false => Ok(()),
    }
}

/// Record `image.json` of any kind of image.
///
/// # Errors
/// [`ReadError::Io`], [`ReadError::Metadata`].
pub fn record(folder: &Path) -> Result<Value, ReadError> {
    let path = folder.join(METADATA);
    let io = |source| ReadError::Io {
        path: path.clone(),
        source,
    };
    let file = open_file(&path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    if bytes > RECORD_LIMITS.bytes {
        return Err(ReadError::Metadata {
            path,
            what: format!(
                "expected at most {} bytes for the record of an image, found more",
                RECORD_LIMITS.bytes
            ),
        });
    }
    json::value(file, RECORD_LIMITS).map_err(|error| match error {
        JsonError::Io(source) => io(source),
        error => ReadError::Metadata {
            path: path.clone(),
            what: error.to_string(),
        },
    })
}

fn open_how(folder: &Path, checked: bool) -> Result<OpenProduct, ReadError> {
    let path = folder.join(METADATA);
    let wrong = |what: String| ReadError::Metadata {
        path: path.clone(),
        what,
    };
    let metadata = record(folder)?;
    if metadata["grid"].is_null() {
        let kind = metadata["schema"].as_str().unwrap_or("unknown kind");
        return Err(wrong(format!(
            "expected an image of subap focus with a grid, found {kind}"
        )));
    }
    let grid = grid(&metadata["grid"]).map_err(wrong)?;
    if let Some(fault) = grid.fault() {
        return Err(wrong(fault.to_string()));
    }
    let pixels = match metadata["files"][tiles::NAME].is_null() {
        true => Pixels::Array(open_image(folder, &metadata, checked)?),
        false => Pixels::Tiles(open_tiles(folder)?),
    };
    let (rows, columns) = pixels.size();
    if (rows, columns) != (grid.rows.count, grid.columns.count) {
        return Err(wrong(format!(
            "the grid has {} rows x {} columns, but the image {} x {}",
            grid.rows.count, grid.columns.count, rows, columns
        )));
    }
    Ok(OpenProduct {
        pixels,
        grid,
        metadata,
    })
}

/// Open `image.npy`, checked if requested.
fn open_image(folder: &Path, metadata: &Value, checked: bool) -> Result<ImageFile, ReadError> {
    // Opened once, so that the checked file is the one that is read, even if another is renamed into its place.
    let image = folder.join(IMAGE);
    let mut file = open_file(&image).map_err(|source| ReadError::Io {
        path: image.clone(),
        source,
    })?;
    if checked {
        check(&mut file, &image, &metadata["files"][IMAGE])?;
    }
    Ok(ImageFile::of(file, &image)?)
}

/// Open `image.zarr`, whose tiles are checked when they are read.
fn open_tiles(folder: &Path) -> Result<TileStore, ReadError> {
    TileStore::open(folder)?.ok_or_else(|| ReadError::Changed {
        path: folder.join(tiles::NAME),
        what: "it is not there".to_owned(),
    })
}

/// Compare size and CRC-32 of a file with the metadata. Leaves the file at its start.
fn check(file: &mut File, path: &Path, about: &Value) -> Result<(), ReadError> {
    let failed = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let stamp = Stamp::of(file).map_err(failed)?;
    let (bytes, crc32) = checksum(file).map_err(failed)?;
    file.rewind().map_err(failed)?;
    if let Some(how) = stamp.difference(file).map_err(failed)? {
        return Err(ReadError::Changed {
            path: path.to_owned(),
            what: format!("it was changed while it was read ({how})"),
        });
    }
    let changed = |what: String| {
        Err(ReadError::Changed {
            path: path.to_owned(),
            what,
        })
    };
    match (about["bytes"].as_u64(), about["crc32"].as_str()) {
        (Some(stated), _) if stated != bytes => {
            changed(format!("expected {stated} bytes, found {bytes}"))
        }
        (Some(_), Some(stated)) if stated == crc32 => Ok(()),
        (Some(_), Some(stated)) => changed(format!("expected CRC-32 {stated}, found {crc32}")),
        _ => changed("its size and CRC-32 are not recorded".to_owned()),
    }
}

/// Grid as recorded by `subap focus`, or in text form.
fn grid(value: &Value) -> Result<ImageGrid, String> {
    if let Some(text) = value.as_str() {
        return text
            .parse()
            .map_err(|_| format!("expected a grid, found '{text}'"));
    }
    let missing = |what: &str| format!("grid.{what} is missing or invalid");
    let axis = |name: &str| {
        let number = |key: &str| value[name][key].as_f64().filter(|v| v.is_finite());
        let count = value[name]["count"]
            .as_u64()
            .filter(|&n| n > 0 && n <= 1_000_000_000);
        match (number("start"), number("step").filter(|&s| s > 0.0), count) {
            (Some(start), Some(step), Some(count)) => Ok(Axis {
                start,
                step,
                count: count as usize,
            }),
            _ => Err(missing(name)),
        }
    };
    let vector = |name: &str| {
        let numbers: Option<Vec<f64>> = value[name]
            .as_array()
            .and_then(|list| list.iter().map(Value::as_f64).collect());
        match numbers.as_deref() {
            Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
            _ => Err(missing(name)),
        }
    };
    Ok(ImageGrid {
        origin_m: vector("origin_m")?,
        x_axis: vector("x_axis")?,
        y_axis: vector("y_axis")?,
        columns: axis("columns")?,
        rows: axis("rows")?,
        polar: match value["kind"].as_str() {
            Some("polar") => true,
            Some("cartesian") => false,
            _ => return Err(missing("kind")),
        },
        relief: relief(&value["relief"])?,
    })
}

/// Heights above the plane of the grid, if pixels are not in the plane.
fn relief(value: &Value) -> Result<Option<Relief>, String> {
    match value.is_null() {
        true => Ok(None),
        false => Relief::deserialize(value)
            .map(Some)
            .map_err(|error| format!("grid.relief: {error}")),
    }
}
