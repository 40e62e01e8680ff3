//! Metadata of the array, `zarr.json`.

use serde::Deserialize;
use serde_json::{Value, json};
use subaperture_model::image::Tiling;

use crate::json::Limits;

/// Limits on the metadata; written files have about a kilobyte.
pub(super) const LIMITS: Limits = Limits {
    bytes: 64 << 10,
    string_bytes: 1 << 10,
    value_bytes: 0,
};

/// Maximum number of rows or columns.
const MAX_SIDE: u64 = 1_000_000_000;

/// Maximum bytes of a tile; planned tiles have about 2^20 pixels, or the smallest unit of a former.
const LARGEST_TILE_BYTES: u64 = 1 << 28;

pub(super) fn tile_bytes(tiling: &Tiling) -> u64 {
    8 * (tiling.tile[0] as u64) * (tiling.tile[1] as u64)
}

/// Metadata of an array in tiles.
pub(super) fn describe(tiling: &Tiling) -> Value {
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": tiling.image,
        "data_type": "complex64",
        "chunk_grid": {
            "name": "regular",
            "configuration": { "chunk_shape": tiling.tile },
        },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": [0.0, 0.0],
        "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
        "dimension_names": ["row", "column"],
        "attributes": {},
    })
}

/// Metadata as read.
#[derive(Deserialize)]
pub(super) struct Array {
    shape: [u64; 2],
    data_type: String,
    chunk_grid: ChunkGrid,
    codecs: [Codec; 1],
}

#[derive(Deserialize)]
struct ChunkGrid {
    configuration: ChunkShape,
}

#[derive(Deserialize)]
struct ChunkShape {
    chunk_shape: [u64; 2],
}

#[derive(Deserialize)]
struct Codec {
    configuration: Endian,
}

#[derive(Deserialize)]
struct Endian {
    endian: String,
}

impl Array {
    /// Sizes of image and tiles, for an uncompressed little-endian complex64 array.
    pub(super) fn tiling(&self) -> Result<Tiling, String> {
        let [Codec { configuration }] = &self.codecs;
        if self.data_type != "complex64" || configuration.endian != "little" {
            return Err(format!(
                "expected complex64 in little-endian bytes, found {} in {}-endian",
                self.data_type, configuration.endian
            ));
        }
        let tile = self.chunk_grid.configuration.chunk_shape;
        let mut sides = self.shape.iter().chain(&tile);
        if !sides.all(|side| (1..=MAX_SIDE).contains(side)) {
            return Err(format!(
                "expected 1 to {MAX_SIDE} rows and columns, found an image of {:?} and tiles of {tile:?}",
                self.shape
            ));
        }
        let tiling = Tiling {
            image: self.shape.map(|side| side as usize),
            tile: tile.map(|side| side as usize),
        };
        match tile_bytes(&tiling) {
            bytes if bytes > LARGEST_TILE_BYTES => Err(format!(
                "expected tiles of at most {LARGEST_TILE_BYTES} bytes, found {bytes}"
            )),
            _ => Ok(tiling),
        }
    }
}
