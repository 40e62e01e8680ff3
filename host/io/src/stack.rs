//! Several images of one grid as one Zarr group of the third version (zarr-specs.readthedocs.io), as xarray and GDAL read it.
//!
//! | array | shape | holds |
//! |---|---|---|
//! | `image` | stack, y, x | `complex64`, chunks of one image's tile each |
//! | `y`, `x` | y; x | float64: the grid's rows and columns, metres in its plane (of a polar grid range, and angle in radians) |
//! | `stack` | stack | int64: the images' numbers, from 0 |
//! | `time` | stack | int64: when each recording began, nanoseconds since 1970; left out unless all tell |
//!
//! Names, units and attributes follow the CF conventions as far as these go. All metadata are in the group's `zarr.json` too
//! (consolidated), so that one read opens it. Nothing is compressed.
//!
//! **Complete or absent.** The folder is made beside its place and renamed. Memory: a tile.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::atomic::{WriteError, check_room, sync_folder};
use super::input::open_file;
use super::json::{self, Limits};
use super::moves;
use super::place::OutputPlace;
use super::unfinished::{self, Thing};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{ImageSource, ImageSourceError, Tiling};
use subaperture_model::monitor::Monitor;

/// The `schema` among a group's attributes.
pub const SCHEMA: &str = "subaperture-stack";

/// What describes a group or array.
const DESCRIPTION: &str = "zarr.json";

/// Rows and columns of a tile.
const TILE: usize = 512;

/// Bounds on a description that is read.
const LIMITS: Limits = Limits {
    bytes: 16 << 20,
    string_bytes: 1 << 20,
    value_bytes: 0,
};

/// Images of one grid.
#[derive(Clone, Copy, Debug)]
pub struct Stack<'a> {
    /// The images, all of the grid's size.
    pub images: &'a [&'a dyn ImageSource],
    /// Where their pixels are.
    pub grid: &'a ImageGrid,
    /// When the recording of each began, nanoseconds since 1970; empty if not all tell.
    pub start_ns: &'a [i64],
    /// What else is known of them: an object, for the group's attributes.
    pub attributes: &'a Value,
}

/// Why a stack was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StackError {
    /// An image cannot be read.
    #[error(transparent)]
    Read(#[from] ImageSourceError),
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The monitor asked for the end.
    #[error("interrupted")]
    Cancelled,
}

impl Stack<'_> {
    fn tiling(&self) -> Tiling {
        let image = [self.grid.rows.count, self.grid.columns.count];
        Tiling {
            image,
            tile: image.map(|side| side.min(TILE)),
        }
    }

    /// Bytes on disk, but for descriptions.
    pub fn bytes(&self) -> u64 {
        let tiling = self.tiling();
        let tile = 8 * tiling.tile[0] as u64 * tiling.tile[1] as u64;
        tile * tiling.count() as u64 * self.images.len() as u64
    }

    /// Writes the group as the folder `path`; one of this program that stands there is replaced.
    ///
    /// # Errors
    /// [`StackError`]; then `path` is as it was.
    ///
    /// # Panics
    /// If an image is not of the grid's size, or there are times and not one of each image.
    pub fn write(&self, path: &Path, monitor: &dyn Monitor) -> Result<(), StackError> {
        let size = (self.grid.rows.count, self.grid.columns.count);
        assert!(self.images.iter().all(|image| image.size() == size));
        assert!([0, self.images.len()].contains(&self.start_ns.len()));
        let place = OutputPlace::of_folder(path)?;
        let failed = |source: io::Error| WriteError::Io {
            path: path.to_owned(),
            needed_bytes: self.bytes(),
            source,
        };
        check_room(path, place.folder(), self.bytes())?;
        place.lock.sweep(place.folder());
        let beside = StagedFolder::create(place.folder().join(place.lock.hidden_name(".zarr")))
            .map_err(failed)?;
        self.write_images(&beside.0, monitor, &failed)?;
        self.describe(&beside.0).map_err(failed)?;
        Ok(beside.put_in_place(&place, failed)?)
    }

    fn write_images(
        &self,
        folder: &Path,
        monitor: &dyn Monitor,
        failed: &dyn Fn(io::Error) -> WriteError,
    ) -> Result<(), StackError> {
        let tiling = self.tiling();
        let count = tiling.count() * self.images.len();
        for (n, image) in self.images.iter().enumerate() {
            for index in 0..tiling.count() {
                if monitor.cancelled() {
                    return Err(StackError::Cancelled);
                }
                let part = image.window(&tiling.place(index))?;
                let mut bytes = Vec::with_capacity(8 * tiling.tile[0] * tiling.tile[1]);
                for row in 0..tiling.tile[0] {
                    let values = part.pixels.chunks_exact(part.columns).nth(row);
                    let values = values.into_iter().flatten();
                    bytes.extend(values.flat_map(|z| [z.re, z.im]).flat_map(f32::to_le_bytes));
                    // Tiles at the ends are filled up.
                    bytes.resize(8 * tiling.tile[1] * (row + 1), 0);
                }
                let [row, column] = tiling.at(index);
                let keys = [n, row, column];
                chunk(&folder.join("image"), &keys, &bytes).map_err(failed)?;
                let done = n * tiling.count() + index + 1;
                monitor.progress(done as f64 / count as f64);
            }
        }
        Ok(())
    }

    /// Writes coordinates and descriptions.
    fn describe(&self, folder: &Path) -> io::Result<()> {
        let Self { images, grid, .. } = self;
        let tiling = self.tiling();
        let mut all = Map::new();
        let image = json!({
            "long_name": "complex image; a unit scatterer on a pixel reads 1",
            "units": "1",
        });
        let image = Array {
            kind: "complex64",
            shape: &[images.len(), tiling.image[0], tiling.image[1]],
            chunks: &[1, tiling.tile[0], tiling.tile[1]],
            fill: json!([0.0, 0.0]),
            dimensions: &["stack", "y", "x"],
            attributes: image,
        };
        image.write(folder, "image", &mut all)?;
        let [rows, columns] = match grid.polar {
            false => [
                json!({ "units": "m", "axis": "Y", "long_name": "y in the grid's plane" }),
                json!({ "units": "m", "axis": "X", "long_name": "x in the grid's plane" }),
            ],
            true => [
                json!({ "units": "m", "axis": "Y", "long_name": "range from the grid's origin" }),
                json!({ "units": "radian", "axis": "X", "long_name": "angle from the grid's x axis" }),
            ],
        };
        for (name, axis, attributes) in [("y", &grid.rows, rows), ("x", &grid.columns, columns)] {
            write_axis(folder, name, axis, attributes, &mut all)?;
        }
        let numbers: Vec<i64> = (0..images.len() as i64).collect();
        let about =
            json!({ "long_name": "number of the image, of the sources in the group's attributes" });
        write_integers(folder, "stack", &numbers, about, &mut all)?;
        if !self.start_ns.is_empty() {
            let about = json!({
                "standard_name": "time",
                "long_name": "when the recording began",
                "units": "nanoseconds since 1970-01-01T00:00:00",
                "calendar": "proleptic_gregorian",
            });
            write_integers(folder, "time", self.start_ns, about, &mut all)?;
        }
        let mut attributes = self.attributes.clone();
        attributes["schema"] = SCHEMA.into();
        attributes["Conventions"] = "CF-1.11".into();
        let group = json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": attributes,
            "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": all },
        });
        write_json(&folder.join(DESCRIPTION), &group)?;
        sync_folder(folder)
    }
}

/// Whether a folder is a group of Zarr, and one that [`Stack::write`] wrote.
pub(super) fn is_group(folder: &Path) -> [bool; 2] {
    #[derive(Deserialize, Default)]
    struct About {
        node_type: String,
        #[serde(default)]
        attributes: Attributes,
    }
    #[derive(Deserialize, Default)]
    struct Attributes {
        schema: Option<String>,
    }
    let about = open_file(&folder.join(DESCRIPTION)).ok();
    let about = about.and_then(|file| json::typed(file, LIMITS).ok());
    let about: About = about.unwrap_or_default();
    let is_zarr = about.node_type == "group";
    [
        is_zarr,
        is_zarr && about.attributes.schema.as_deref() == Some(SCHEMA),
    ]
}

/// A folder on its way into place, removed when dropped, if it is still there.
struct StagedFolder(PathBuf);

impl StagedFolder {
    fn create(path: PathBuf) -> io::Result<Self> {
        fs::create_dir(&path)?;
        unfinished::begin(Thing::Folder(path.clone()));
        Ok(Self(path))
    }

    /// Renames it to its place; an older folder is moved aside first, and removed.
    fn put_in_place(
        self,
        place: &OutputPlace,
        failed: impl Fn(io::Error) -> WriteError,
    ) -> Result<(), WriteError> {
        moves::all(
            |moves| {
                let moved = moves.put(&self.0, &place.path, &place.lock);
                moved.map_err(&failed)
            },
            &failed,
        )
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
        unfinished::end(&self.0);
    }
}

/// What is said of an array.
struct Array<'a> {
    kind: &'a str,
    shape: &'a [usize],
    chunks: &'a [usize],
    fill: Value,
    dimensions: &'a [&'a str],
    attributes: Value,
}

impl Array<'_> {
    /// Describes the array `name` of a group, there and among `all`.
    fn write(&self, folder: &Path, name: &str, all: &mut Map<String, Value>) -> io::Result<()> {
        let array = json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": self.shape,
            "data_type": self.kind,
            "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": self.chunks } },
            "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
            "fill_value": self.fill,
            "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
            "dimension_names": self.dimensions,
            "attributes": self.attributes,
        });
        write_json(&folder.join(name).join(DESCRIPTION), &array)?;
        all.insert(name.to_owned(), array);
        Ok(())
    }
}

/// Most values of a coordinate's chunk.
const COORDINATES: usize = 1 << 16;

/// An array of one dimension, of `count` values of eight bytes.
fn write_line(
    folder: &Path,
    name: &str,
    kind: &str,
    count: usize,
    value: impl Fn(usize) -> [u8; 8],
    attributes: Value,
    all: &mut Map<String, Value>,
) -> io::Result<()> {
    let chunk_values = count.min(COORDINATES);
    for (n, first) in (0..count).step_by(chunk_values).enumerate() {
        let values = first..count.min(first + chunk_values);
        let mut bytes: Vec<u8> = values.flat_map(&value).collect();
        bytes.resize(8 * chunk_values, 0);
        chunk(&folder.join(name), &[n], &bytes)?;
    }
    let array = Array {
        kind,
        shape: &[count],
        chunks: &[chunk_values],
        fill: match kind {
            "int64" => json!(0),
            _ => json!(0.0),
        },
        dimensions: &[match name {
            "time" => "stack",
            name => name,
        }],
        attributes,
    };
    array.write(folder, name, all)
}

fn write_axis(
    folder: &Path,
    name: &str,
    axis: &Axis,
    attributes: Value,
    all: &mut Map<String, Value>,
) -> io::Result<()> {
    let value = |i| axis.at(i).to_le_bytes();
    write_line(folder, name, "float64", axis.count, value, attributes, all)
}

fn write_integers(
    folder: &Path,
    name: &str,
    values: &[i64],
    attributes: Value,
    all: &mut Map<String, Value>,
) -> io::Result<()> {
    let value = |i: usize| values[i].to_le_bytes();
    write_line(folder, name, "int64", values.len(), value, attributes, all)
}

/// Writes the chunk of these numbers of an array.
fn chunk(array: &Path, numbers: &[usize], bytes: &[u8]) -> io::Result<()> {
    let mut path = array.join("c");
    path.extend(numbers.iter().map(usize::to_string));
    write_file(&path, bytes)
}

fn write_json(path: &Path, value: &Value) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    write_file(path, &text)
}

/// Writes a file in a folder that is made if need be, forced to the disk.
fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder)?;
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}
