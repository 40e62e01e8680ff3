//! Writing of Zarr v3 arrays: metadata and uncompressed chunks.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use serde_json::{Map, Value, json};

use subaperture_model::geometry::Axis;

/// Name of the metadata file of a group or array.
pub(super) const DESCRIPTION: &str = "zarr.json";

/// Metadata of an array.
pub(super) struct Array<'a> {
    pub(super) kind: &'a str,
    pub(super) shape: &'a [usize],
    pub(super) chunks: &'a [usize],
    pub(super) fill: Value,
    pub(super) dimensions: &'a [&'a str],
    pub(super) attributes: Value,
}

impl Array<'_> {
    /// Write the metadata of the array `name` to its folder, and add them to `all`.
    pub(super) fn write(
        &self,
        folder: &Path,
        name: &str,
        all: &mut Map<String, Value>,
    ) -> io::Result<()> {
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

/// Maximum number of values in a chunk of a coordinate.
const COORDINATES: usize = 1 << 16;

/// Write a one-dimensional array of `count` values of eight bytes.
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

pub(super) fn write_axis(
    folder: &Path,
    name: &str,
    axis: &Axis,
    attributes: Value,
    all: &mut Map<String, Value>,
) -> io::Result<()> {
    let value = |i| axis.at(i).to_le_bytes();
    write_line(folder, name, "float64", axis.count, value, attributes, all)
}

pub(super) fn write_integers(
    folder: &Path,
    name: &str,
    values: &[i64],
    attributes: Value,
    all: &mut Map<String, Value>,
) -> io::Result<()> {
    let value = |i: usize| values[i].to_le_bytes();
    write_line(folder, name, "int64", values.len(), value, attributes, all)
}

/// Write the chunk with these indices of an array.
pub(super) fn chunk(array: &Path, numbers: &[usize], bytes: &[u8]) -> io::Result<()> {
    let mut path = array.join("c");
    path.extend(numbers.iter().map(usize::to_string));
    write_file(&path, bytes)
}

pub(super) fn write_json(path: &Path, value: &Value) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    write_file(path, &text)
}

/// Write and sync a file in a folder that is created if missing.
fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder)?;
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}
