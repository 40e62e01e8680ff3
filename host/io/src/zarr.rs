//! Complex images in Zarr v3 arrays (zarr-specs.readthedocs.io), read in parts.
//!
//! Supported are `complex64` arrays of two dimensions (rows, columns), or of three (image, rows, columns) of which
//! one image is selected, in uncompressed little-endian chunks on a regular grid, as written by [`crate::stack`] and
//! [`crate::tiles`]. Compressed chunks and other types are refused by name. A missing chunk has the fill value.
//!
//! A group is opened by its array `image`, or by its only complex array. **Memory**: that of the part read.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use num_complex::Complex32;
use serde_json::Value;

use crate::ReadError;
use crate::input::open_file;
use crate::json::{self, JsonError, Limits};

use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, Tiling, blocks,
};

/// Name of the metadata file of a group or array.
const DESCRIPTION: &str = "zarr.json";
/// Limits on the metadata.
const LIMITS: Limits = Limits {
    bytes: 16 << 20,
    string_bytes: 1 << 20,
    value_bytes: 16 << 20,
};
/// Maximum number of rows or columns. Chunks may be missing, so the file size limits nothing.
const LONGEST: u64 = 1_000_000_000;
const MAX_PIXELS: u128 = 1 << 36;

/// Complex image in a Zarr array.
#[derive(Debug)]
pub struct ZarrImage {
    array: PathBuf,
    tiling: Tiling,
    /// Index of the image and number of images, for an array of three dimensions.
    layer: Option<(usize, usize)>,
    separator: String,
    /// Whether chunk keys begin with `c`.
    default_keys: bool,
    fill: Complex32,
    /// Attributes of the group, or of a single array.
    attributes: Value,
    grid: Option<ImageGrid>,
}

/// Whether a folder is a Zarr group or array.
pub fn is_zarr(folder: &Path) -> bool {
    folder.join(DESCRIPTION).is_file()
}

impl ZarrImage {
    /// Open a group or an array; `layer` is the index of an image among several, from 0.
    ///
    /// # Errors
    /// [`ReadError`], also if there are several images and `layer` is `None`.
    pub fn open(folder: &Path, layer: Option<usize>) -> Result<Self, ReadError> {
        let about = description(folder)?;
        let (array, about, attributes) = match about["node_type"].as_str() {
            Some("array") => {
                let attributes = about["attributes"].clone();
                (folder.to_owned(), about, attributes)
            }
            Some("group") => {
                let array = image_of_group(folder, &about)?;
                let own = description(&array)?;
                (array, own, about["attributes"].clone())
            }
            _ => {
                return Err(wrong(
                    folder,
                    "expected a Zarr group or array of version 3 (zarr_format 3, node_type)",
                ));
            }
        };
        let mut image = Self::of(array, &about, attributes, layer)?;
        image.grid = image.grid_of(folder);
        Ok(image)
    }

    fn of(
        array: PathBuf,
        about: &Value,
        attributes: Value,
        layer: Option<usize>,
    ) -> Result<Self, ReadError> {
        let wrong = |what: String| wrong(&array, what);
        let text = |value: &Value| value.as_str().unwrap_or("nothing").to_owned();
        if about["data_type"] != "complex64" {
            return Err(wrong(format!(
                "expected data_type complex64, found {}",
                about["data_type"]
            )));
        }
        if about["chunk_grid"]["name"] != "regular" {
            return Err(wrong(format!(
                "expected a regular chunk_grid, found {}",
                text(&about["chunk_grid"]["name"])
            )));
        }
        let codecs = about["codecs"].as_array().cloned().unwrap_or_default();
        let names: Vec<String> = codecs.iter().map(|codec| text(&codec["name"])).collect();
        let little = codecs
            .first()
            .is_some_and(|codec| codec["configuration"]["endian"] == "little");
        if names != ["bytes"] || !little {
            return Err(wrong(format!(
                "expected plain little-endian chunks (codec bytes), found codecs {}: write it without compression",
                names.join(", ")
            )));
        }
        let counts = |value: &Value| -> Option<Vec<usize>> {
            let counts = value.as_array()?.iter();
            let counts = counts.map(|n| n.as_u64().filter(|n| (1..=LONGEST).contains(n)));
            counts.map(|n| n.map(|n| n as usize)).collect()
        };
        let shape = counts(&about["shape"]);
        let chunk = counts(&about["chunk_grid"]["configuration"]["chunk_shape"]);
        let (Some(shape), Some(chunk)) = (shape, chunk) else {
            return Err(wrong(format!(
                "expected shape and chunk_shape of 1 to {LONGEST} a side, found {} and {}",
                about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"]
            )));
        };
        let (layer, tiling) = match (&shape[..], &chunk[..]) {
            (&[rows, columns], &[high, wide]) => {
                which(1, layer).map_err(&wrong)?;
                let tiling = Tiling {
                    image: [rows, columns],
                    tile: [high, wide],
                };
                (None, tiling)
            }
            (&[count, rows, columns], &[1, high, wide]) => (
                Some((which(count, layer).map_err(&wrong)?, count)),
                Tiling {
                    image: [rows, columns],
                    tile: [high, wide],
                },
            ),
            _ => {
                return Err(wrong(format!(
                    "expected rows x columns, or images x rows x columns in chunks of one image; found shape {shape:?} in chunks {chunk:?}"
                )));
            }
        };
        let pixels = tiling.image[0] as u128 * tiling.image[1] as u128;
        if pixels > MAX_PIXELS {
            return Err(wrong(format!(
                "expected at most {MAX_PIXELS} pixels, found {} rows x {} columns",
                tiling.image[0], tiling.image[1]
            )));
        }
        let default_keys = match about["chunk_key_encoding"]["name"].as_str() {
            Some("default") => true,
            Some("v2") => false,
            other => {
                return Err(wrong(format!(
                    "expected chunk_key_encoding default or v2, found {}",
                    other.unwrap_or("nothing")
                )));
            }
        };
        let separator = about["chunk_key_encoding"]["configuration"]["separator"].as_str();
        let separator = separator.unwrap_or(if default_keys { "/" } else { "." });
        if !["/", "."].contains(&separator) {
            return Err(wrong(format!(
                "expected the separator / or ., found {separator:?}"
            )));
        }
        let separator = separator.to_owned();
        let part = |i: usize| about["fill_value"][i].as_f64().unwrap_or(0.0) as f32;
        Ok(Self {
            fill: Complex32::new(part(0), part(1)),
            array,
            tiling,
            layer,
            separator,
            default_keys,
            attributes,
            grid: None,
        })
    }

    /// Attributes of the group, or of a single array.
    pub fn attributes(&self) -> &Value {
        &self.attributes
    }

    /// Index of the image in its array, and number of images.
    pub fn layer(&self) -> Option<(usize, usize)> {
        self.layer
    }

    /// Pixel grid, for a group written by [`crate::stack`] with images in a plane.
    pub fn grid(&self) -> Option<&ImageGrid> {
        self.grid.as_ref()
    }

    /// Scene frame, for a group written by [`crate::stack`] with images in a plane.
    pub fn frame(&self) -> Option<SceneFrame> {
        self.grid.as_ref()?;
        let Some(origin_ecf_m) = self.vector("frame_origin_ecf_m") else {
            return Some(SceneFrame::Local);
        };
        let frame = SceneFrame::Earth {
            origin_ecf_m,
            x_axis_ecf: self.vector("frame_x_axis_ecf")?,
            y_axis_ecf: self.vector("frame_y_axis_ecf")?,
        };
        frame.is_sound().then_some(frame)
    }

    fn vector(&self, name: &str) -> Option<glam::DVec3> {
        let list = self.attributes[name].as_array()?;
        let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
        match numbers[..] {
            [x, y, z] => Some(glam::DVec3::new(x, y, z)),
            _ => None,
        }
    }

    fn grid_of(&self, group: &Path) -> Option<ImageGrid> {
        let flag = |name: &str| self.attributes[name].as_bool();
        if flag("grid_has_relief")? {
            return None;
        }
        let [rows, columns] = self.tiling.image;
        let grid = ImageGrid {
            origin_m: self.vector("grid_origin_m")?,
            x_axis: self.vector("grid_x_axis")?,
            y_axis: self.vector("grid_y_axis")?,
            rows: axis(&group.join("y"), rows)?,
            columns: axis(&group.join("x"), columns)?,
            polar: flag("grid_is_polar")?,
            relief: None,
        };
        grid.fault().is_none().then_some(grid)
    }

    fn chunk(&self, index: usize) -> PathBuf {
        let [row, column] = self.tiling.at(index);
        let mut keys: Vec<String> = Vec::with_capacity(4);
        if self.default_keys {
            keys.push("c".to_owned());
        }
        keys.extend(self.layer.map(|(layer, _)| layer.to_string()));
        keys.extend([row.to_string(), column.to_string()]);
        self.array.join(keys.join(&self.separator))
    }

    /// Read the part of a chunk within a block into the block's pixels. A missing chunk leaves the fill value, with
    /// which the pixels are initialised.
    fn read(
        &self,
        index: usize,
        place: &PixelBlock,
        out: &mut [Complex32],
    ) -> Result<(), ReadError> {
        let chunk = self.tiling.place(index);
        let path = self.chunk(index);
        let failed = ReadError::io(&path);
        let mut file = match open_file(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            opened => opened.map_err(&failed)?,
        };
        let [high, wide] = self.tiling.tile;
        let needed = 8 * u128::from(high as u64) * u128::from(wide as u64);
        let bytes = file.metadata().map_err(&failed)?.len();
        if u128::from(bytes) != needed {
            return Err(wrong(
                &path,
                format!("expected a chunk of {needed} bytes, found {bytes}"),
            ));
        }
        let common =
            [0, 1].map(|i| place[i].start.max(chunk[i].start)..place[i].end.min(chunk[i].end));
        let [rows, columns] = common;
        let mut line = vec![0; 8 * columns.len()];
        for row in rows {
            let pixel = (row - chunk[0].start) * wide + columns.start - chunk[1].start;
            file.seek(SeekFrom::Start(8 * pixel as u64))
                .map_err(&failed)?;
            file.read_exact(&mut line).map_err(&failed)?;
            let at = (row - place[0].start) * place[1].len() + columns.start - place[1].start;
            let values = line.chunks_exact(8).map(complex);
            out[at..at + columns.len()]
                .iter_mut()
                .zip(values)
                .for_each(|(out, value)| *out = value);
        }
        Ok(())
    }
}

impl ImageSource for ZarrImage {
    fn size(&self) -> (usize, usize) {
        let [rows, columns] = self.tiling.image;
        (rows, columns)
    }

    fn places(&self) -> PixelBlocks {
        let (rows, columns) = self.size();
        blocks(rows, columns)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let [rows, columns] = place;
        let mut window = Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: vec![self.fill; rows.len() * columns.len()],
        };
        for index in self.tiling.meeting(place) {
            self.read(index, place, &mut window.pixels)?;
        }
        Ok(window)
    }
}

/// Index of the selected image among `count`.
fn which(count: usize, layer: Option<usize>) -> Result<usize, String> {
    match layer {
        Some(layer) if layer < count => Ok(layer),
        Some(layer) => Err(format!(
            "expected an image number below {count}, found {layer}"
        )),
        None if count == 1 => Ok(0),
        None => Err(format!(
            "expected one image, found {count}: select one by its number, FOLDER:0 to FOLDER:{}",
            count - 1
        )),
    }
}

/// Path of the image array in a group.
fn image_of_group(folder: &Path, about: &Value) -> Result<PathBuf, ReadError> {
    let named = folder.join("image");
    if is_zarr(&named) {
        return Ok(named);
    }
    let members = about["consolidated_metadata"]["metadata"].as_object();
    let complex = members.into_iter().flatten().filter(|(name, array)| {
        let plain = !name.is_empty() && !name.contains(['/', '\\']) && *name != "..";
        plain && array["data_type"] == "complex64"
    });
    let names: Vec<&String> = complex.map(|(name, _)| name).collect();
    match names[..] {
        [name] => Ok(folder.join(name)),
        _ => Err(wrong(
            folder,
            format!(
                "expected a group with an array 'image', or with one complex64 array; found {}",
                names.len()
            ),
        )),
    }
}

/// Evenly spaced axis from the first two values of a float64 array.
fn axis(array: &Path, count: usize) -> Option<Axis> {
    let about = description(array).ok()?;
    let plain = about["data_type"] == "float64" && about["shape"][0].as_u64() == Some(count as u64);
    if !plain {
        return None;
    }
    let mut file = open_file(&array.join("c").join("0")).ok()?;
    let mut number = || {
        let mut bytes = [0; 8];
        file.read_exact(&mut bytes).ok()?;
        Some(f64::from_le_bytes(bytes))
    };
    let start = number()?;
    // A single row or column has no step.
    let step = if count > 1 { number()? - start } else { 1.0 };
    Some(Axis { start, step, count })
}

fn complex(bytes: &[u8]) -> Complex32 {
    let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    Complex32::new(number(&bytes[..4]), number(&bytes[4..]))
}

fn wrong(path: &Path, what: impl Into<String>) -> ReadError {
    ReadError::malformed(path, what)
}

fn description(folder: &Path) -> Result<Value, ReadError> {
    let path = folder.join(DESCRIPTION);
    let failed = ReadError::io(&path);
    let file = open_file(&path).map_err(&failed)?;
    json::value(file, LIMITS).map_err(|error| match error {
        JsonError::Io(source) => failed(source),
        error => wrong(&path, error.to_string()),
    })
}
