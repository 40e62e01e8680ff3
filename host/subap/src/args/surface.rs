//! The grid of an image and the surface on which it lies.

use std::fmt;
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args as Group, ValueHint};
use serde::{Deserialize, Deserializer};
use subaperture::geometry::{ImageGrid, Troposphere};
use subaperture::terrain::{Geoid, PixelSurface};

use super::settings::{optional, parsed, parsed_by};

/// Pixels of an image and the surface on which they lie.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct GridSettings {
    /// Pixels, metres in the scene frame, stop excluded: x=-50:50:0.2,y=-50:50:0.2,z=0 (one step is enough for both) or polar r=..,theta=..
    /// (degrees); also cx, cy, yaw, pitch, roll [default: the scene's extent at half the resolution]
    #[arg(long = "grid", value_name = "GRID", allow_hyphen_values = true)]
    #[serde(deserialize_with = "optional")]
    pub(crate) pixels: Option<ImageGrid>,

    /// Surface of the pixels: plane, that of the grid; slant, the slant plane of the collection (x of the grid is then cross-range, y range);
    /// hae, a constant height above the ellipsoid, metres, by default that of the grid's origin; or dem, an elevation model (SRTM .hgt, GeoTIFF)
    /// or a folder of them. Pixels of hae and dem are moved vertically from the grid onto the surface
    #[arg(long, value_name = "plane|slant|hae[:M]|dem:FILE", default_value_t, value_parser = surface_kind(), allow_hyphen_values = true)]
    #[serde(deserialize_with = "parsed")]
    pub(crate) surface: PixelSurface,

    /// Geoid undulation, which is added to the heights of an elevation model: metres, or a file in a format of elevation models [default: 0,
    /// heights are above the ellipsoid]
    #[arg(long, value_name = "M|FILE", value_hint = ValueHint::FilePath, value_parser = geoid(), allow_hyphen_values = true)]
    #[serde(deserialize_with = "geoid_of_job")]
    pub(crate) geoid: Option<Geoid>,

    /// Tropospheric delay to be removed, relative to the recording's reference point: none, or an exponential profile with a refractivity of N
    /// parts per million at sea level (313 if omitted)
    #[arg(long, value_name = "none|exponential[:N]", default_value_t)]
    #[serde(deserialize_with = "parsed")]
    pub(crate) troposphere: Air,
}

/// Model of the troposphere; `None` if its delay is not removed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Air(pub(crate) Option<Troposphere>);

impl fmt::Display for Air {
    /// Text of the option.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => f.write_str("none"),
            Some(air) => air.fmt(f),
        }
    }
}

impl FromStr for Air {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self(None)),
            text => text.parse().map(|air| Self(Some(air))),
        }
    }
}

fn surface_kind() -> impl TypedValueParser<Value = PixelSurface> {
    PathBufValueParser::new().try_map(|path| match path.to_str() {
        Some(text) => text.parse(),
        None => Err("give dem:FILE with a name in UTF-8".to_owned()),
    })
}

fn geoid() -> impl TypedValueParser<Value = Geoid> {
    PathBufValueParser::new().try_map(Geoid::parse)
}

fn geoid_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Geoid>, D::Error> {
    parsed_by(from, |text| Geoid::parse(text.into())).map(Some)
}
