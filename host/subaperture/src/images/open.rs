//! Opening an image of any format.

use std::io::Read;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use subaperture_focus::Plan;
use subaperture_io::ReadError;
use subaperture_io::input::open_file;
use subaperture_io::json;
use subaperture_io::npy::ImageFile;
use subaperture_io::product::{self, RECORD_LIMITS};
use subaperture_io::tiles::{self, StoreError, TileStore};
use subaperture_io::zarr::{self, ZarrImage};
use subaperture_maps::terrain::TerrainError;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::ImageSource;
use subaperture_sicd::{SicdFile, SiddFile, is_sidd};

use super::{MapImage, OpenImage, PartialImage, PixelGeometry, Pixels, Values};
use crate::on_map::SicdOnMap;

/// File name of a product's record.
const RECORD: &str = "image.json";
/// File name of a product's array.
const ARRAY: &str = "image.npy";
/// Schema of the record of a velocity plane.
const VELOCITY_PLANE: &str = "subaperture-velocity-plane";

/// Options for opening an image.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Maximum size of an unpacked part of a file, such as a GeoTIFF tile, and of parsed XML, bytes. Default: 256 MiB.
    pub memory_bytes: u64,
    /// Whether an array in a product's folder is read once to verify its CRC-32. Default: true.
    pub verified: bool,
}

impl Default for Reading {
    /// Memory of 256 MiB, with verification.
    fn default() -> Self {
        Self {
            memory_bytes: 256 << 20,
            verified: true,
        }
    }
}

/// Error of opening an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// Error of reading a file.
    #[error(transparent)]
    File(#[from] ReadError),
    /// The path is not an image.
    #[error(
        "{}: expected an image: the folder of a product (with image.json and image.npy), a complex64 array (.npy), a SICD or SIDD, a GeoTIFF, or a Zarr \
         group{found}", path.display()
    )]
    NoImage {
        /// Path of the file.
        path: PathBuf,
        /// Kind of the file found, after a semicolon; empty if unknown.
        found: String,
    },
    /// The image has no pixels.
    #[error("{}: expected an image, found one without pixels", path.display())]
    Empty {
        /// Path of the image.
        path: PathBuf,
    },
    /// Error of reading a product.
    #[error(transparent)]
    Product(#[from] product::ReadError),
    /// Error of reading tiles.
    #[error(transparent)]
    Tiles(#[from] StoreError),
    /// Error of reading a GeoTIFF.
    #[error(transparent)]
    Map(#[from] TerrainError),
}

/// Folder of the product at a path: the path itself, or the folder of its `image.json`.
pub fn product_folder(path: &Path) -> Option<&Path> {
    if path.is_dir() {
        return Some(path);
    }
    let is_record = path.file_name().is_some_and(|name| name == RECORD);
    let folder = path.parent().filter(|_| is_record)?;
    Some(match folder == Path::new("") {
        true => Path::new("."),
        false => folder,
    })
}

impl OpenImage {
    /// Open the image at a path, in any format of the [module](super)'s table.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(path: &Path, reading: &Reading) -> Result<Self, OpenError> {
        if let Some(folder) = product_folder(path) {
            return of_folder(path, folder, None, reading);
        }
        if let Some((folder, layer)) = numbered(path) {
            return of_folder(path, &folder, Some(layer), reading);
        }
        let mut start = [0; 4];
        // Reading from a pipe here would consume its bytes.
        if !path.is_file() {
            let missing = open_file(path).err();
            return Err(match missing {
                Some(source) => ReadError::io(path)(source).into(),
                None => no_image(path, "; found neither a file nor a folder"),
            });
        }
        let read = open_file(path).and_then(|file| file.take(4).read(&mut start));
        read.map_err(ReadError::io(path))?;
        match &start {
            b"\x93NUM" => array(path, path, Pixels::Array),
            b"NITF" | b"NSIF" if is_sidd(path) => sidd(path, reading),
            b"NITF" | b"NSIF" => sicd(path, reading),
            b"II*\0" | b"MM\0*" | b"II+\0" | b"MM\0+" => map(path, reading),
            _ => Err(no_image(path, "")),
        }
    }
}

fn no_image(path: &Path, found: &str) -> OpenError {
    OpenError::NoImage {
        path: path.to_owned(),
        found: found.to_owned(),
    }
}

/// Folder and image number of `FOLDER:N`, where no file has that name.
fn numbered(path: &Path) -> Option<(PathBuf, usize)> {
    let (folder, number) = path.to_str()?.rsplit_once(':')?;
    let number = number.parse().ok()?;
    let folder = PathBuf::from(folder);
    (!path.exists() && zarr::is_zarr(&folder)).then_some((folder, number))
}

fn of_folder(
    path: &Path,
    folder: &Path,
    layer: Option<usize>,
    reading: &Reading,
) -> Result<OpenImage, OpenError> {
    let record = folder.join(RECORD);
    if record.exists() || path.file_name().is_some_and(|name| name == RECORD) {
        return match schema(&record).as_deref() {
            Some(VELOCITY_PLANE) => {
                let mut image = array(path, &folder.join(ARRAY), Pixels::Velocity)?;
                image.record = record_of(&record);
                Ok(image)
            }
            _ => product(path, folder, reading),
        };
    }
    if zarr::is_zarr(folder) {
        // The path is the tile store of a product.
        let product_of = folder
            .parent()
            .filter(|_| folder.join("plan.json").exists());
        return match product_of {
            Some(_) if folder.file_name().is_some_and(|name| name == tiles::NAME) => {
                of_folder(path, &folder.join(".."), None, reading)
            }
            _ => zarr_image(path, folder, layer),
        };
    }
    match TileStore::open(folder)? {
        Some(store) => Ok(unfinished(path, store)),
        None => Err(no_image(
            path,
            "; a product is a folder with image.json and image.npy, found a folder without image.json, image.zarr and zarr.json",
        )),
    }
}

/// Parsed text of a record.
fn record_of(path: &Path) -> Option<Value> {
    json::value(open_file(path).ok()?, RECORD_LIMITS).ok()
}

/// Schema of a record of any size.
fn schema(path: &Path) -> Option<String> {
    #[derive(Deserialize)]
    struct Keys {
        schema: Option<String>,
    }
    let file = open_file(path).ok()?;
    let keys: Keys = json::typed(file, RECORD_LIMITS).ok()?;
    keys.schema
}

/// Array without position metadata. `file` is opened; `path` is the user's name for the image.
fn array(
    path: &Path,
    file: &Path,
    pixels: fn(ImageFile) -> Pixels,
) -> Result<OpenImage, OpenError> {
    let file = ImageFile::open(file)?;
    if file.size().0 == 0 || file.size().1 == 0 {
        return Err(OpenError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(OpenImage {
        path: path.to_owned(),
        pixels: pixels(file),
        values: Values::Complex,
        lies: PixelGeometry::Pixels,
        record: None,
    })
}

fn product(path: &Path, folder: &Path, reading: &Reading) -> Result<OpenImage, OpenError> {
    let stored = match reading.verified {
        true => product::open(folder)?,
        false => product::open_unread(folder)?,
    };
    Ok(OpenImage {
        path: path.to_owned(),
        lies: PixelGeometry::Grid {
            frame: product::frame_of(&stored.metadata).ok(),
            grid: stored.grid,
        },
        pixels: Pixels::Product(stored.pixels),
        values: Values::Complex,
        record: Some(stored.metadata),
    })
}

fn unfinished(path: &Path, store: TileStore) -> OpenImage {
    let plan = Plan::from_text(store.plan()).ok();
    let size = store.size();
    let fits = |grid: &ImageGrid| (grid.rows.count, grid.columns.count) == size;
    let grid = plan.map(|plan| plan.grid).filter(fits);
    OpenImage {
        path: path.to_owned(),
        lies: grid.map_or(PixelGeometry::Pixels, |grid| PixelGeometry::Grid {
            grid,
            frame: None,
        }),
        pixels: Pixels::Unfinished(PartialImage::new(store)),
        values: Values::Complex,
        record: None,
    }
}

fn zarr_image(path: &Path, folder: &Path, layer: Option<usize>) -> Result<OpenImage, OpenError> {
    let image = ZarrImage::open(folder, layer)?;
    let lies = match image.grid() {
        Some(grid) => PixelGeometry::Grid {
            grid: grid.clone(),
            frame: image.frame(),
        },
        None => PixelGeometry::Pixels,
    };
    Ok(OpenImage {
        path: path.to_owned(),
        record: source_of(&image),
        lies,
        values: values_of(image.attributes()),
        pixels: Pixels::Zarr(image),
    })
}

/// Meaning of the values of a group. Default: complex.
fn values_of(attributes: &Value) -> Values {
    let about = &attributes["values"];
    let level = |i: usize| about["levels_db"][i].as_f64();
    match (about.as_str(), level(0).zip(level(1))) {
        (Some("amplitudes"), _) => Values::Amplitudes,
        (Some("greys"), _) => Values::Greys,
        (_, Some((black, white))) => Values::Levels([black, white]),
        _ => Values::Complex,
    }
}

/// Record keys of one image in a group written by Subaperture: the keys of a product's record.
fn source_of(image: &ZarrImage) -> Option<Value> {
    let layer = image.layer().map_or(0, |(layer, _)| layer);
    let source = image.attributes()["sources"].get(layer)?;
    let mut record = json!({
        "settings": source["settings"],
        "support": source["support"],
        "antennas": source["antennas"],
        "collection": source["recording"],
        "inputs": source["inputs"],
        "picture": { "title": source["title"] },
    });
    if let Some(frame) = image.frame() {
        record["frame"] = product::record::frame(&frame);
    }
    Some(record)
}

fn sicd(path: &Path, reading: &Reading) -> Result<OpenImage, OpenError> {
    let file = SicdFile::open_within(path, reading.memory_bytes)?;
    let on_map = SicdOnMap::new(&file).map_err(|error| error.to_string());
    Ok(OpenImage {
        path: path.to_owned(),
        lies: PixelGeometry::Sicd {
            plane: file.plane(),
            on_map: Box::new(on_map),
        },
        pixels: Pixels::Sicd(file),
        values: Values::Complex,
        record: None,
    })
}

fn sidd(path: &Path, reading: &Reading) -> Result<OpenImage, OpenError> {
    let file = SiddFile::open_within(path, reading.memory_bytes)?;
    let lies = match file.plane() {
        Some(plane) => PixelGeometry::Grid {
            grid: plane.grid.clone(),
            frame: Some(plane.frame),
        },
        None => PixelGeometry::Pixels,
    };
    Ok(OpenImage {
        path: path.to_owned(),
        lies,
        values: file.levels_db().map_or(Values::Greys, Values::Levels),
        pixels: Pixels::Sidd(file),
        record: None,
    })
}

fn map(path: &Path, reading: &Reading) -> Result<OpenImage, OpenError> {
    let image = MapImage::open(path, reading.memory_bytes)?;
    Ok(OpenImage {
        path: path.to_owned(),
        lies: image
            .raster()
            .map_or(PixelGeometry::Pixels, PixelGeometry::Map),
        values: image.values(),
        pixels: Pixels::Map(Box::new(image)),
        record: None,
    })
}

impl OpenImage {
    /// Grid of rows and columns, for an image without pixel positions.
    pub fn pixel_grid(&self) -> ImageGrid {
        let (rows, columns) = self.pixels.size();
        let axis = |count| Axis {
            start: 0.0,
            step: 1.0,
            count,
        };
        ImageGrid::horizontal(axis(columns), axis(rows), 0.0)
    }

    /// Whether rows are numbered downwards in display: in SICD, SIDD and maps.
    pub fn rows_down(&self) -> bool {
        matches!(
            self.pixels,
            Pixels::Sicd(_) | Pixels::Sidd(_) | Pixels::Map(_)
        )
    }

    /// Folder of a product, complete or in progress.
    pub fn folder(&self) -> Option<&Path> {
        match self.pixels {
            Pixels::Product(_) | Pixels::Velocity(_) | Pixels::Unfinished(_) => {
                product_folder(&self.path)
            }
            _ => None,
        }
    }
}
