//! Names of image formats.

use std::fmt;

use super::{OpenImage, Pixels, Values};

/// Format of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageKind {
    /// Product of `subap focus`.
    Product,
    /// Product whose tiles are being formed.
    Unfinished,
    /// Product of `subap velocity`.
    Velocity,
    /// Array without metadata.
    Array,
    /// Array in Zarr format.
    Zarr,
    /// Complex image in SICD format.
    Sicd,
    /// Detected image in SIDD format.
    Sidd,
    /// Raster in GeoTIFF format.
    Map,
}

impl OpenImage {
    /// Format of the opened image.
    pub fn kind(&self) -> ImageKind {
        match &self.pixels {
            Pixels::Product(_) => ImageKind::Product,
            Pixels::Unfinished(_) => ImageKind::Unfinished,
            Pixels::Velocity(_) => ImageKind::Velocity,
            Pixels::Array(_) => ImageKind::Array,
            Pixels::Zarr(_) => ImageKind::Zarr,
            Pixels::Sicd(_) => ImageKind::Sicd,
            Pixels::Sidd(_) => ImageKind::Sidd,
            Pixels::Map(_) => ImageKind::Map,
        }
    }
}

impl fmt::Display for ImageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Product => "product",
            Self::Unfinished => "product in progress",
            Self::Velocity => "velocity plane",
            Self::Array => "array",
            Self::Zarr => "Zarr image",
            Self::Sicd => "SICD",
            Self::Sidd => "SIDD",
            Self::Map => "GeoTIFF",
        })
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Complex => f.write_str("complex"),
            Self::Amplitudes => f.write_str("amplitudes"),
            Self::Levels([black, white]) => {
                write!(f, "levels from {black:.2} to {white:.2} dB in 8 bits")
            }
            Self::Greys => f.write_str("greys of unknown scale"),
        }
    }
}
