//! Map products of `subap export`.

use clap::{Args as Group, ValueEnum};
use serde::Deserialize;
use subaperture::maps::Remap;
use subaperture::units::Dimension;

use super::values::{above_zero, any, positive};

/// Settings of map products.
#[derive(Clone, Copy, Debug, Default, Group)]
#[command(next_help_heading = "Maps")]
pub(crate) struct Mapping {
    /// Coordinates of the map: UTM, or longitude and latitude [default: utm; geographic for KMZ]
    #[arg(long, value_enum)]
    pub(crate) projection: Option<MapProjection>,

    /// Pixel spacing on the ground, metres or with a unit; pixels coarser than those of the image are means of its power [default: that of the image]
    #[arg(long, value_name = "LENGTH", value_parser = above_zero(Dimension::Length))]
    pub(crate) pixel: Option<f64>,

    /// Multilook: mean power of N x N pixels of the image in each pixel of the map [default: 1]
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "pixel")]
    pub(crate) looks: Option<usize>,

    /// Bands of the GeoTIFF [default: db]
    #[arg(long, value_enum)]
    pub(crate) layout: Option<MapLayout>,

    /// Mapping of magnitudes to greys [default: db for a GeoTIFF, which then states its levels, else density]
    #[arg(long, value_enum)]
    pub(crate) remap: Option<RemapName>,

    /// Upper level (white), dB [default: that of the remap]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) top: Option<f64>,

    /// Dynamic range from white to black, dB [default: that of the remap]
    #[arg(long, value_name = "DB", value_parser = above_zero(Dimension::Level))]
    pub(crate) span: Option<f64>,
}

impl Mapping {
    /// Whether any setting is given.
    pub(crate) fn is_given(&self) -> bool {
        let Self {
            projection,
            pixel,
            looks,
            layout,
            remap,
            top,
            span,
        } = self;
        projection.is_some()
            || pixel.is_some()
            || looks.is_some()
            || layout.is_some()
            || remap.is_some()
            || top.is_some()
            || span.is_some()
    }
}

/// Projections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapProjection {
    /// UTM zone of the scene centre
    Utm,
    /// Longitude and latitude (EPSG:4326)
    Geographic,
}

/// Bands of a GeoTIFF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapLayout {
    /// Decibels in 8 bits
    #[default]
    Db,
    /// Amplitude, float32
    Amplitude,
    /// Real and imaginary part, float32
    Complex,
}

/// Remaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RemapName {
    /// Decibels, down to 6 dB below the median, 40 to 60 dB
    #[default]
    Db,
    /// Relative to the mean magnitude, as sarpy's Density: bright points do not darken the rest
    Density,
}

impl RemapName {
    /// Text of the option.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Db => "db",
            Self::Density => "density",
        }
    }
}

impl From<RemapName> for Remap {
    fn from(name: RemapName) -> Self {
        match name {
            RemapName::Db => Self::Decibels,
            RemapName::Density => Self::Density,
        }
    }
}
