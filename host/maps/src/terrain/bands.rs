//! Reader of georeferenced GeoTIFF images, window by window.
//!
//! Strips or tiles, uncompressed or Deflate, LZW or PackBits, one or more bands interleaved by pixel, integers or floating point (crate `tiff`). Geographic tags
//! are returned unparsed ([`GeoTiff::tags`]). Not supported: complex sample formats, bands interleaved by plane, JPEG.
//!
//! **Memory** the window, and one strip or tile.

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

use tiff::ColorType;
use tiff::tags::Tag;

use crate::terrain::TerrainError;
use crate::terrain::chunks::Chunks;
pub use crate::terrain::geokeys::Tags;

/// `PlanarConfiguration` of bands interleaved by pixel.
const PIXEL_INTERLEAVED: u16 = 1;

/// Open GeoTIFF with numeric bands.
#[derive(Debug)]
pub struct GeoTiff {
    path: PathBuf,
    chunks: Chunks,
    /// Whether samples are bytes.
    bytes: bool,
}

impl GeoTiff {
    /// Open a file. `allowed_bytes` bounds its directory and one strip or tile.
    ///
    /// # Errors
    /// [`TerrainError::Io`]; [`TerrainError::Format`] if the file is damaged or not supported.
    pub fn open(path: &Path, allowed_bytes: u64) -> Result<Self, TerrainError> {
        let file = File::open(path).map_err(|source| TerrainError::Io {
            path: path.to_owned(),
            source,
        })?;
        let format = |what: String| TerrainError::Format {
            path: path.to_owned(),
            what,
        };
        let mut chunks = Chunks::open(file, allowed_bytes).map_err(format)?;
        let bits = match chunks.colour {
            ColorType::Gray(bits) => bits,
            ColorType::Multiband { bit_depth, .. } => bit_depth,
            other => {
                return Err(format(format!(
                    "expected bands of numbers, found colour type {other:?}"
                )));
            }
        };
        let planar = chunks.number(Tag::PlanarConfiguration);
        if chunks.bands > 1 && planar.is_some_and(|planar| planar != PIXEL_INTERLEAVED) {
            return Err(format(
                "expected bands interleaved by pixel (PlanarConfiguration 1); convert it, for example with gdal_translate -co INTERLEAVE=PIXEL"
                    .to_owned(),
            ));
        }
        Ok(Self {
            path: path.to_owned(),
            chunks,
            bytes: bits == 8,
        })
    }

    /// Rows and columns, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.chunks.size
    }

    /// Number of bands (samples per pixel).
    pub fn bands(&self) -> usize {
        self.chunks.bands
    }

    /// Whether samples have 8 bits.
    pub fn is_bytes(&self) -> bool {
        self.bytes
    }

    /// Geographic tags.
    pub fn tags(&self) -> &Tags {
        &self.chunks.tags
    }

    /// Item of `GDAL_METADATA` by its role, first band: `scale`, `offset`, `unittype` or `description`.
    pub fn item(&self, role: &str) -> Option<&str> {
        let marked = format!("role=\"{role}\">");
        let after = self.chunks.metadata.split_once(&marked)?.1;
        after.split_once('<').map(|(value, _)| value)
    }

    /// Read a window: row by row, the bands of a pixel adjacent; NaN where the file has no data.
    ///
    /// # Errors
    /// [`TerrainError::Format`] if a strip or tile cannot be decoded.
    pub fn window(&mut self, window: &[Range<usize>; 2]) -> Result<Vec<f32>, TerrainError> {
        let read = self.chunks.window(window);
        read.map_err(|what| TerrainError::Format {
            path: self.path.clone(),
            what,
        })
    }
}
