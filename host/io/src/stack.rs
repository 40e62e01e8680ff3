//! Stack of images on one grid as a Zarr v3 group (zarr-specs.readthedocs.io), readable by xarray and GDAL.
//!
//! | array | shape | content |
//! |---|---|---|
//! | `image` | stack, y, x | `complex64`, one chunk per tile of an image |
//! | one per measure | y, x | `float32`, such as the coherence of two images; NaN where undefined |
//! | one per measure of each image | stack, y, x | `float32`, such as the displacement in each pass; NaN where undefined |
//! | `y`, `x` | y; x | float64: rows and columns of the grid, metres in its plane (for a polar grid range in metres and angle in radians) |
//! | `stack` | stack | int64: image numbers from 0 |
//! | `time` | stack | int64: start of each recording, nanoseconds since 1970; omitted unless known for all |
//!
//! Names, units and attributes follow the CF conventions where these apply. All metadata are also in the group's
//! `zarr.json` (consolidated), so that one read opens it. Nothing is compressed.
//!
//! **Atomic output.** The folder is written under a hidden name and renamed. Memory: one tile.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::atomic::{WriteError, check_room, sync_folder};
use super::input::open_file;
use super::json::{self, Limits};
use super::moves;
use super::place::OutputPlace;
use super::unfinished::{self, Unfinished};
use super::zarr_arrays::{Array, DESCRIPTION, chunk, write_axis, write_integers, write_json};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{ImageSource, ImageSourceError, Tiling};
use subaperture_model::monitor::Monitor;

/// Value of `schema` in the group's attributes.
pub const SCHEMA: &str = "subaperture-stack";

/// Number of rows and columns of a tile.
const TILE: usize = 512;

/// Limits on the metadata file.
const LIMITS: Limits = Limits {
    bytes: 16 << 20,
    string_bytes: 1 << 20,
    value_bytes: 0,
};

/// Images on one grid.
#[derive(Clone, Copy, Debug)]
pub struct Stack<'a> {
    /// Images, all of the grid's size.
    pub images: &'a [&'a dyn ImageSource],
    /// Grid of the pixels.
    pub grid: &'a ImageGrid,
    /// Start of each recording in nanoseconds since 1970; empty unless known for all.
    pub start_ns: &'a [i64],
    /// Measures of the images, stored as arrays of their own.
    pub measures: &'a [Measure<'a>],
    /// Further attributes of the group, a JSON object.
    pub attributes: &'a Value,
}

/// Real value per pixel of a stack's grid, common to all images or one for each.
#[derive(Clone, Copy, Debug)]
pub struct Measure<'a> {
    /// Name of the array, such as `coherence`.
    pub name: &'a str,
    /// Description of the values, for readers.
    pub long_name: &'a str,
    /// Units after the CF conventions.
    pub units: &'a str,
    /// Values in row-major order: those of one grid, or of as many as there are images, in their order.
    pub values: &'a [f32],
}

impl Measure<'_> {
    /// Number of grids: 1, or that of the images. `None` for any other number of values.
    fn layers(&self, pixels: usize, images: usize) -> Option<usize> {
        [1, images]
            .into_iter()
            .find(|layers| self.values.len() == layers * pixels)
    }
}

/// Reason why a stack was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StackError {
    /// An image cannot be read.
    #[error(transparent)]
    Read(#[from] ImageSourceError),
    /// The stack cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The monitor asked to stop.
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

    /// Size on disk in bytes, without metadata.
    pub fn bytes(&self) -> u64 {
        let tiling = self.tiling();
        let tile = 8 * tiling.tile[0] as u64 * tiling.tile[1] as u64;
        let pixels = tiling.image[0] * tiling.image[1];
        let layers = self
            .measures
            .iter()
            .map(|measure| measure.values.len() / pixels.max(1));
        let images = 2 * self.images.len() + layers.sum::<usize>();
        tile / 2 * tiling.count() as u64 * images as u64
    }

    /// Write the group as the folder `path`. An existing stack of this program is replaced.
    ///
    /// # Errors
    /// [`StackError`]; `path` is then unchanged.
    ///
    /// # Panics
    /// Panics if an image does not have the grid's size, if a measure has neither that size nor that of all images together, or if the number of times is not zero or that of
    /// the images.
    pub fn write(&self, path: &Path, monitor: &dyn Monitor) -> Result<(), StackError> {
        let size = (self.grid.rows.count, self.grid.columns.count);
        assert!(self.images.iter().all(|image| image.size() == size));
        let pixels = size.0 * size.1;
        let filled = |measure: &Measure| measure.layers(pixels, self.images.len()).is_some();
        assert!(self.measures.iter().all(filled));
        assert!([0, self.images.len()].contains(&self.start_ns.len()));
        let place = OutputPlace::of_folder(path)?;
        let failed = |source: io::Error| WriteError::Io {
            path: path.to_owned(),
            needed_bytes: self.bytes(),
            source,
        };
        check_room(path, place.folder(), self.bytes())?;
        place.lock.sweep(place.folder());
        let staged = StagedFolder::create(place.folder().join(place.lock.hidden_name(".zarr")))
            .map_err(failed)?;
        self.write_images(&staged.0, monitor, &failed)?;
        self.write_measures(&staged.0).map_err(failed)?;
        self.describe(&staged.0).map_err(failed)?;
        Ok(staged.put_in_place(&place, failed)?)
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
                    // Tiles at the edges are padded with zeros.
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

    fn write_measures(&self, folder: &Path) -> io::Result<()> {
        let pixels = self.grid.rows.count * self.grid.columns.count;
        for measure in self.measures {
            let folder = folder.join(measure.name);
            match measure.layers(pixels, self.images.len()) {
                Some(1) => self.write_layer(&folder, &[], measure.values)?,
                _ => {
                    for (n, values) in measure.values.chunks_exact(pixels).enumerate() {
                        self.write_layer(&folder, &[n], values)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Write the tiles of one grid of values; their keys begin with `layer`.
    fn write_layer(&self, folder: &Path, layer: &[usize], values: &[f32]) -> io::Result<()> {
        let tiling = self.tiling();
        for index in 0..tiling.count() {
            let [rows, columns] = tiling.place(index);
            let mut bytes = Vec::with_capacity(4 * tiling.tile[0] * tiling.tile[1]);
            for row in 0..tiling.tile[0] {
                if row < rows.len() {
                    let first = (rows.start + row) * tiling.image[1] + columns.start;
                    let values = &values[first..first + columns.len()];
                    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
                }
                // Tiles at the edges are padded with zeros.
                bytes.resize(4 * tiling.tile[1] * (row + 1), 0);
            }
            let keys = [layer, &tiling.at(index)].concat();
            chunk(folder, &keys, &bytes)?;
        }
        Ok(())
    }

    /// Write coordinates and metadata.
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
        for measure in self.measures {
            let [image, tile] = [tiling.image, tiling.tile];
            let several = measure.values.len() > image[0] * image[1];
            // Without the dimension of the stack for a measure that all images have in common.
            let from = usize::from(!several);
            let shape = [images.len(), image[0], image[1]];
            let chunks = [1, tile[0], tile[1]];
            let array = Array {
                kind: "float32",
                shape: &shape[from..],
                chunks: &chunks[from..],
                fill: json!("NaN"),
                dimensions: &["stack", "y", "x"][from..],
                attributes: json!({ "long_name": measure.long_name, "units": measure.units }),
            };
            array.write(folder, measure.name, &mut all)?;
        }
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

/// Whether a folder is a Zarr group, and whether [`Stack::write`] wrote it.
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

/// Hidden folder, removed when dropped unless it was renamed.
struct StagedFolder(PathBuf);

impl StagedFolder {
    fn create(path: PathBuf) -> io::Result<Self> {
        fs::create_dir(&path)?;
        unfinished::begin(Unfinished::Folder(path.clone()));
        Ok(Self(path))
    }

    /// Rename the folder to its place. An older folder is renamed aside first, and then removed.
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
