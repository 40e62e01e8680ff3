//! The grid of an image and the surface on which it lies.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args as Group, ValueHint};
use serde::{Deserialize, Deserializer};
use subaperture::geometry::{ImageGrid, Troposphere};
use subaperture::terrain::Geoid;
use subaperture::units::Dimension;

use super::settings::{optional, parsed, parsed_by};
use super::values::any;

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
    pub(crate) surface: SurfaceKind,

    /// Geoid undulation, which is added to the heights of an elevation model: metres, or a file in a format of elevation models [default: 0,
    /// heights are above the ellipsoid]
    #[arg(long, value_name = "M|FILE", value_hint = ValueHint::FilePath, value_parser = geoid(), allow_hyphen_values = true)]
    #[serde(deserialize_with = "geoid_of_job")]
    pub(crate) geoid: Option<GeoidSource>,

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
            Some(air) => write!(f, "exponential:{}", air.refractivity),
        }
    }
}

impl FromStr for Air {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refractivity = match text.split_once(':') {
            None if text == "none" => return Ok(Self(None)),
            None if text == "exponential" => Some(Troposphere::MEAN_REFRACTIVITY),
            Some(("exponential", number)) => number.parse().ok(),
            _ => None,
        };
        match refractivity.filter(|n| (0.0..=1000.0).contains(n)) {
            Some(refractivity) => Ok(Self(Some(Troposphere { refractivity }))),
            None => Err("give none, exponential, or exponential:N with 0 to 1000 parts in a million at sea level (as exponential:313)".to_owned()),
        }
    }
}

/// Surface of the pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum SurfaceKind {
    #[default]
    Plane,
    Slant,
    /// Height above the ellipsoid, metres, if one is given.
    Ellipsoid(Option<f64>),
    Dem(PathBuf),
}

impl SurfaceKind {
    /// The file or folder, if it is of one.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::Dem(path) => Some(path),
            _ => None,
        }
    }
}

impl fmt::Display for SurfaceKind {
    /// Text of the option.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plane => f.write_str("plane"),
            Self::Slant => f.write_str("slant"),
            Self::Ellipsoid(None) => f.write_str("hae"),
            Self::Ellipsoid(Some(height_m)) => write!(f, "hae:{height_m}"),
            Self::Dem(path) => write!(f, "dem:{}", path.display()),
        }
    }
}

/// Source of geoid undulations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum GeoidSource {
    Metres(f64),
    File(PathBuf),
}

impl GeoidSource {
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::Metres(_) => None,
            Self::File(path) => Some(path),
        }
    }

    /// As the library has it.
    pub(crate) fn geoid(&self) -> Geoid {
        match self {
            Self::Metres(metres) => Geoid::Undulation(*metres),
            Self::File(path) => Geoid::File(path.clone()),
        }
    }
}

impl fmt::Display for GeoidSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Metres(metres) => write!(f, "{metres}"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// A height or undulation, metres, that the Earth may have.
fn height(text: &str) -> Result<f64, String> {
    let height_m = any(Dimension::Length)(text)?;
    match height_m.abs() <= 1e5 {
        true => Ok(height_m),
        false => Err(format!(
            "{height_m} m is beyond the Earth's surface: heights of at most 100 km are possible"
        )),
    }
}

/// Expected texts of a surface.
const SURFACES: &str = "give plane, slant, hae, hae:HEIGHT (as hae:43m) or dem:FILE";

impl FromStr for SurfaceKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None => match text {
                "plane" => Ok(Self::Plane),
                "slant" => Ok(Self::Slant),
                "hae" => Ok(Self::Ellipsoid(None)),
                _ => Err(SURFACES.to_owned()),
            },
            Some(("hae", text)) => height(text).map(|h| Self::Ellipsoid(Some(h))),
            Some(("dem", path)) if !path.is_empty() => Ok(Self::Dem(path.into())),
            Some(_) => Err(SURFACES.to_owned()),
        }
    }
}

fn surface_kind() -> impl TypedValueParser<Value = SurfaceKind> {
    PathBufValueParser::new().try_map(|path| match path.to_str() {
        Some(text) => text.parse(),
        None => Err(format!("{SURFACES}, of a name in UTF-8")),
    })
}

fn geoid() -> impl TypedValueParser<Value = GeoidSource> {
    PathBufValueParser::new().try_map(geoid_source)
}

/// A text that begins as a number is one, unless there is a file of this name.
fn geoid_source(path: PathBuf) -> Result<GeoidSource, String> {
    match path.to_str() {
        Some(text)
            if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
                && !path.exists() =>
        {
            height(text).map(GeoidSource::Metres)
        }
        _ => Ok(GeoidSource::File(path)),
    }
}

fn geoid_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<GeoidSource>, D::Error> {
    parsed_by(from, |text| geoid_source(text.into())).map(Some)
}
