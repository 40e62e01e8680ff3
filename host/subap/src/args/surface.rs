//! On which surface an image is focused.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args as Group, ValueHint};
use subaperture::geometry::Troposphere;
use subaperture::terrain::Geoid;
use subaperture::units::Dimension;

use super::values::any;

/// On which surface pixels lie.
#[derive(Debug, Group)]
pub(crate) struct Surfacing {
    /// Where pixels lie: in the grid's plane; in the slant plane of the collection (then x of --grid is cross-range, y range); on the surface of
    /// constant height above the ellipsoid, in metres, through the grid's origin unless one is given; or on the ground, of an elevation model (SRTM
    /// .hgt, GeoTIFF) or a folder of them. Pixels of the last two are the grid's own, up or down to the surface
    #[arg(long, value_name = "plane|slant|hae[:M]|dem:FILE", default_value = "plane", value_parser = surface_kind(), allow_hyphen_values = true)]
    pub(crate) surface: SurfaceKind,

    /// What lies between the ellipsoid and the level above which an elevation model states its heights: metres, or a file of undulations read as
    /// an elevation model is [default: nothing, heights are taken as above the ellipsoid]
    #[arg(long, value_name = "M|FILE", value_hint = ValueHint::FilePath, value_parser = geoid(), allow_hyphen_values = true)]
    pub(crate) geoid: Option<GeoidSource>,

    /// Take the air's delay away, of an exponential profile with N parts in a million of refractivity at sea level [default of N: 313], as it is from the
    /// recording's reference point
    #[arg(long, value_name = "none|exponential[:N]", default_value = "none", value_parser = troposphere)]
    pub(crate) troposphere: Air,
}

/// The troposphere, if it is taken away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Air(pub(crate) Option<Troposphere>);

impl fmt::Display for Air {
    /// As it is typed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => f.write_str("none"),
            Some(air) => write!(f, "exponential:{}", air.refractivity),
        }
    }
}

fn troposphere(text: &str) -> Result<Air, String> {
    let refractivity = match text.split_once(':') {
        None if text == "none" => return Ok(Air(None)),
        None if text == "exponential" => Some(Troposphere::MEAN_REFRACTIVITY),
        Some(("exponential", number)) => number.parse().ok(),
        _ => None,
    };
    match refractivity.filter(|n| (0.0..=1000.0).contains(n)) {
        Some(refractivity) => Ok(Air(Some(Troposphere { refractivity }))),
        None => Err("give none, exponential, or exponential:N with 0 to 1000 parts in a million at sea level (as exponential:313)".to_owned()),
    }
}

/// What surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SurfaceKind {
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
    /// As it is typed.
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

/// What the geoid is known by.
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

fn surface_kind() -> impl TypedValueParser<Value = SurfaceKind> {
    PathBufValueParser::new().try_map(|path| {
        let wanted = "give plane, slant, hae, hae:HEIGHT (as hae:43m) or dem:FILE";
        let Some(text) = path.to_str() else {
            return Err(format!("{wanted}, of a name in UTF-8"));
        };
        match text.split_once(':') {
            None => match text {
                "plane" => Ok(SurfaceKind::Plane),
                "slant" => Ok(SurfaceKind::Slant),
                "hae" => Ok(SurfaceKind::Ellipsoid(None)),
                _ => Err(wanted.to_owned()),
            },
            Some(("hae", text)) => height(text).map(|h| SurfaceKind::Ellipsoid(Some(h))),
            Some(("dem", path)) if !path.is_empty() => Ok(SurfaceKind::Dem(path.into())),
            Some(_) => Err(wanted.to_owned()),
        }
    })
}

fn geoid() -> impl TypedValueParser<Value = GeoidSource> {
    PathBufValueParser::new().try_map(|path| match path.to_str() {
        // What begins as a number is one, unless there is such a file.
        Some(text)
            if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
                && !path.exists() =>
        {
            height(text).map(GeoidSource::Metres)
        }
        _ => Ok(GeoidSource::File(path)),
    })
}
