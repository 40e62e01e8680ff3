//! A product read back: image, grid and metadata, checked to belong together.

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

/// Bounds on `image.json`: of a plane it has some kilobytes, and a surface is one string of up to 3.5 MB.
pub const RECORD_LIMITS: Limits = Limits {
    bytes: 4 << 20,
    string_bytes: 4 << 20,
    value_bytes: 5 << 20,
};

/// What a folder holds.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StoredProduct {
    /// The image.
    pub image: Image,
    /// Its grid.
    pub grid: ImageGrid,
    /// The whole of `image.json`.
    pub metadata: Value,
}

/// What a folder holds, pixels still in their files.
#[derive(Debug)]
pub struct OpenProduct {
    /// The image.
    pub pixels: Pixels,
    /// Its grid.
    pub grid: ImageGrid,
    /// The whole of `image.json`.
    pub metadata: Value,
}

/// An image in its files.
#[derive(Debug)]
pub enum Pixels {
    /// One array.
    Array(ImageFile),
    /// Tiles.
    Tiles(TileStore),
}

impl Pixels {
    /// All of it.
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

/// Why a product was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system reported an error.
    #[error("cannot read {}: {source}{}", path.display(), advice(source))]
    Io {
        /// Path of the file that failed.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// `image.json` is not that of a product.
    #[error("{}: {what}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The image is not the one that the metadata are of.
    #[error("{}: {what}, so it is not the image that {METADATA} describes: form it again", path.display())]
    Changed {
        /// The image's file.
        path: PathBuf,
        /// How that shows.
        what: String,
    },
    /// The image is damaged.
    #[error(transparent)]
    Npy(#[from] phase_history::ReadError),
    /// A tile of it is.
    #[error(transparent)]
    Tiles(#[from] StoreError),
}

fn advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::NotFound => "; a product is a folder with image.json and image.npy",
        _ => "",
    }
}

/// Reads a folder that [`super::Product::write`] has left, whose metadata hold a grid.
///
/// # Errors
/// [`ReadError`], also if the image's size or CRC-32 is not what the metadata say.
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

/// Opens such a folder without keeping its pixels, which may be more than memory holds.
///
/// # Errors
/// As [`read`]; of tiles, size and CRC-32 are looked at when they are read.
pub fn open(folder: &Path) -> Result<OpenProduct, ReadError> {
    open_how(folder, true)
}

/// [`open`] without reading an array's pixels at all, so that it is done at once however many they are: [`verify`] does the rest.
///
/// # Errors
/// As [`open`], but for an array's CRC-32.
pub fn open_unread(folder: &Path) -> Result<OpenProduct, ReadError> {
    open_how(folder, false)
}

/// Reads all of an array in the folder of a product that was opened unread, for its size and CRC-32; of tiles there is nothing to do.
///
/// # Errors
/// [`ReadError`] if it is not what the metadata say.
pub fn verify(folder: &Path, metadata: &Value) -> Result<(), ReadError> {
    match metadata["files"][tiles::NAME].is_null() {
        true => open_image(folder, metadata, true).map(drop),
        false => Ok(()),
    }
}

/// The record of an image, `image.json`, of any kind.
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
                "more than {} bytes: no record of an image is so long",
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
            "it holds no grid, for it is of {kind}; an image of subap focus is wanted"
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
            "its grid has {} rows x {} columns, the image {} x {}",
            grid.rows.count, grid.columns.count, rows, columns
        )));
    }
    Ok(OpenProduct {
        pixels,
        grid,
        metadata,
    })
}

/// `image.npy`, checked if that is asked.
fn open_image(folder: &Path, metadata: &Value, checked: bool) -> Result<ImageFile, ReadError> {
    // Opened once, so that what is checked is what is read, whatever is renamed into its place.
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

/// `image.zarr`, whose tiles are checked when they are read.
fn open_tiles(folder: &Path) -> Result<TileStore, ReadError> {
    TileStore::open(folder)?.ok_or_else(|| ReadError::Changed {
        path: folder.join(tiles::NAME),
        what: "it is not there".to_owned(),
    })
}

/// Whether a file has the size and CRC-32 that the metadata say. Leaves it at its start.
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
            changed(format!("it has {bytes} bytes and not {stated}"))
        }
        (Some(_), Some(stated)) if stated == crc32 => Ok(()),
        (Some(_), Some(stated)) => changed(format!("its CRC-32 is {crc32} and not {stated}")),
        _ => changed("no size and CRC-32 of it are recorded".to_owned()),
    }
}

/// A grid as `subap focus` records it, or in text form.
fn grid(value: &Value) -> Result<ImageGrid, String> {
    if let Some(text) = value.as_str() {
        return text
            .parse()
            .map_err(|_| format!("its grid is recorded as '{text}', which is no grid"));
    }
    let missing = |what: &str| format!("grid.{what} is missing or not what subap focus writes");
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

/// Heights over the grid's plane, where pixels do not lie in it.
fn relief(value: &Value) -> Result<Option<Relief>, String> {
    match value.is_null() {
        true => Ok(None),
        false => Relief::deserialize(value)
            .map(Some)
            .map_err(|error| format!("grid.relief is none that subap focus writes: {error}")),
    }
}
