//! Maps that `subap export` makes.

use clap::{Args as Group, ValueEnum};
use serde::Deserialize;
use subaperture::maps::Remap;
use subaperture::units::Dimension;

use super::values::{above_zero, any, positive};

/// How an image is shown on a map.
#[derive(Clone, Copy, Debug, Default, Group)]
#[command(next_help_heading = "Maps")]
pub(crate) struct Mapping {
    /// What the map's coordinates are: UTM, or longitude and latitude [default: utm; of a KMZ geographic]
    #[arg(long, value_enum)]
    pub(crate) projection: Option<MapProjection>,

    /// Distance of the map's pixels on the ground; those coarser than the image's are means of its power [default: the image's own]
    #[arg(long, value_name = "LENGTH", value_parser = above_zero(Dimension::Length))]
    pub(crate) pixel: Option<f64>,

    /// Average the power of N x N of the image's pixels in one of the map's
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "pixel")]
    pub(crate) looks: Option<usize>,

    /// Bands of a GeoTIFF
    #[arg(long, value_enum)]
    pub(crate) layout: Option<MapLayout>,

    /// How magnitudes become greys [default: decibels of a GeoTIFF, which then knows its levels, else density]
    #[arg(long, value_enum)]
    pub(crate) remap: Option<RemapName>,

    /// Level of white, dB [default: the remap's]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) top: Option<f64>,

    /// Levels from white to black, dB [default: the remap's]
    #[arg(long, value_name = "DB", value_parser = above_zero(Dimension::Level))]
    pub(crate) span: Option<f64>,
}

impl Mapping {
    /// Whether any of it was typed.
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
    /// The UTM zone in which the scene's middle lies
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
    /// About the mean magnitude, as sarpy's Density: bright points do not make the rest dark
    Density,
}

impl RemapName {
    /// As it is typed.
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
