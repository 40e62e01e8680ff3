//! `subap export`.

use std::path::{Path, PathBuf};

use clap::{Args as Group, ValueEnum, ValueHint};
use serde::{Deserialize, Deserializer};
use subaperture::geometry::Geodetic;
use subaperture::sicd::SicdVersion;
use subaperture::units::Dimension;

use super::maps::Mapping;
use super::settings::parsed_by;
use super::values::{above_zero, geodetic, one_of, output};

/// Formats of exported images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ImageFormat {
    /// SICD 1.3 (bistatic: 1.4) in NITF 2.1: complex, with metadata for measurement and projection
    Sicd,
    /// SIDD 3.0 in NITF 2.1: greys on the image plane
    Sidd,
    /// Cloud-optimised GeoTIFF with a STAC item; tif is the same
    #[value(aliases = ["tif", "tiff", "geotiff"])]
    #[serde(alias = "tif", alias = "tiff", alias = "geotiff")]
    Cog,
    /// Ground overlays for Google Earth
    Kmz,
    /// Picture, north up, with a world file
    Png,
    /// Zarr group for xarray: one or more complex images of one grid
    Zarr,
}

impl ImageFormat {
    /// Format of a file's extension.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "nitf" | "ntf" => Some(Self::Sicd),
            "tif" | "tiff" => Some(Self::Cog),
            "kmz" => Some(Self::Kmz),
            "png" => Some(Self::Png),
            "zarr" => Some(Self::Zarr),
            _ => None,
        }
    }

    /// Text of the option.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Sicd => "sicd",
            Self::Sidd => "sidd",
            Self::Cog => "cog",
            Self::Kmz => "kmz",
            Self::Png => "png",
            Self::Zarr => "zarr",
        }
    }

    /// File name of the product in the folder of an image.
    pub(crate) fn file_name(self) -> &'static str {
        match self {
            Self::Sicd => "sicd.nitf",
            Self::Sidd => "sidd.nitf",
            Self::Cog => "map.tif",
            Self::Kmz => "map.kmz",
            Self::Png => "map.png",
            Self::Zarr => "stack.zarr",
        }
    }

    /// Whether the format needs the position of the scene on the Earth.
    pub(crate) fn is_of_the_earth(self) -> bool {
        match self {
            Self::Sicd | Self::Sidd | Self::Cog | Self::Kmz | Self::Png => true,
            Self::Zarr => false,
        }
    }
}

/// Products written into the folder of a formed image.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Products")]
pub(crate) struct Producing {
    /// Write the image in these formats too, as subap export does, into its folder: sicd.nitf, sidd.nitf, map.tif (cog), map.kmz,
    /// map.png and stack.zarr
    #[arg(long = "product", value_enum, value_name = "FORMAT[,FORMAT]", value_delimiter = ',', conflicts_with_all = ["from_maps", "plan"])]
    pub(crate) formats: Vec<ImageFormat>,

    /// Position of the scene's origin on the Earth for these products: degrees north and east, metres above the WGS 84 ellipsoid (x is
    /// then east and y north) [default: as the recording states]
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, requires = "formats", value_parser = geodetic)]
    #[serde(deserialize_with = "place_of_job")]
    pub(crate) place: Option<Geodetic>,
}

fn place_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Geodetic>, D::Error> {
    parsed_by(from, geodetic).map(Some)
}

/// `subap export`.
#[derive(Debug, Group)]
pub(crate) struct Export {
    /// Image: folder of a product (image.json and image.npy) or its image.json; for maps also SICD (.nitf); for --format zarr images of any
    /// format, several if they share a grid
    #[arg(required = true, value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) images: Vec<PathBuf>,

    /// Format to write [default: by the extension of FILE: .nitf SICD, .tif, .kmz or .png a map, .zarr a stack]
    #[arg(long, value_enum)]
    pub(crate) format: Option<ImageFormat>,

    /// File to write; a folder for --format zarr
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Position on the Earth of the scene's origin: degrees north and east, metres above the WGS 84 ellipsoid (x is then east and y north)
    /// [default: as the recording states]
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, value_parser = geodetic)]
    pub(crate) place: Option<Geodetic>,

    /// Speed of the radar for SICD and SIDD of a recording without times, m/s or with a unit [default: 100m/s]
    #[arg(long, value_name = "SPEED", value_parser = above_zero(Dimension::Speed))]
    pub(crate) speed: Option<f64>,

    /// Version of SICD [default: the lowest that describes the image: 1.3, or 1.4 for a bistatic one]
    #[arg(long, value_name = "VERSION", value_parser = one_of::<SicdVersion>(&["1.3", "1.4", "1.5"]))]
    pub(crate) sicd_version: Option<SicdVersion>,

    #[command(flatten)]
    pub(crate) maps: Mapping,

    #[command(flatten)]
    pub(crate) writing: super::Writing,
}
