//! `subap displacement`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use subaperture::geometry::Geodetic;
use subaperture::interferometry::displacement::{PointChoice, ScreenModel, StableArea};
use subaperture::io::date;
use subaperture::units::Dimension;

use super::Writing;
use super::pair::PairFormat;
use super::values::{any, finite, geodetic, output, quantity, rectangle};

/// Options of `subap displacement`.
#[derive(Debug, Group)]
#[command(
    after_help = "Displacement is along the line of sight, in millimetres relative to the first pass, positive away from the radar. Without --stable, a motion of the whole\n\
    scene that is uniform or linear in range counts as atmosphere. Neighbouring points must move by less than a quarter of a wavelength relative to each other\n\
    from pass to pass; points at which half-wavelength slips are possible are marked as doubtful."
)]
pub(crate) struct Displacement {
    /// Complex images of two or more passes on one grid: products of subap focus, or layers of a Zarr stack, FOLDER:N
    #[arg(value_name = "IMAGE", required = true, num_args = 2.., value_hint = ValueHint::AnyPath)]
    pub(crate) passes: Vec<PathBuf>,

    /// Folder for displacement.json, points.csv, displacement.png, velocity.png, series.png, and the formats of --format
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Time of each pass, in the order of the passes: seconds, times with units (0,6h,12h), or dates (2026-05-04T14:00:00Z)
    /// [default: recorded]
    #[arg(long, value_name = "TIME,TIME[,TIME]", allow_hyphen_values = true, value_parser = times)]
    pub(crate) times: Option<PassTimes>,

    /// Area at rest, which determines the atmospheric screen and zero displacement: ranges of x and y, or centre and radius,
    /// metres; may be repeated
    #[arg(long, value_name = "X0:X1,Y0:Y1 | X,Y,RADIUS", allow_hyphen_values = true, value_parser = area)]
    pub(crate) stable: Vec<StableArea>,

    /// Largest amplitude dispersion of a persistent point
    #[arg(long, value_name = "D", default_value_t = 0.25, value_parser = finite)]
    pub(crate) dispersion: f64,

    /// Smallest mean power of a persistent point, relative to the median pixel, dB
    #[arg(long, value_name = "DB", default_value_t = 10.0, allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) floor: f64,

    /// Pixels that can be persistent points
    #[arg(long, value_enum, value_name = "CHOICE", default_value = "maxima")]
    pub(crate) points: Choice,

    /// Atmospheric screen of a pass
    #[arg(long, value_enum, value_name = "MODEL", default_value = "linear")]
    pub(crate) screen: Screen,

    /// Position on the Earth of the scene's origin, x to the east, for images that do not state it: degrees north and east,
    /// metres above the ellipsoid
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, value_parser = geodetic)]
    pub(crate) place: Option<Geodetic>,

    /// Write these too: cog (displacement.tif, velocity.tif), zarr (displacement.zarr)
    #[arg(
        long = "format",
        value_enum,
        value_name = "FORMAT[,FORMAT]",
        value_delimiter = ','
    )]
    pub(crate) formats: Vec<PairFormat>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Pixels that can be persistent points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Choice {
    /// Local maxima of the mean power
    Maxima,
    /// All pixels, counted as independent
    All,
}

impl From<Choice> for PointChoice {
    fn from(choice: Choice) -> Self {
        match choice {
            Choice::Maxima => Self::Maxima,
            Choice::All => Self::All,
        }
    }
}

/// Atmospheric screen of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Screen {
    /// Phase linear in range
    Linear,
    /// Phase constant over the scene
    Constant,
}

impl From<Screen> for ScreenModel {
    fn from(screen: Screen) -> Self {
        match screen {
            Screen::Linear => Self::Linear,
            Screen::Constant => Self::Constant,
        }
    }
}

/// Times of the passes, seconds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PassTimes(pub(crate) Vec<f64>);

fn times(text: &str) -> Result<PassTimes, String> {
    let time = |part: &str| match date::nanoseconds(part) {
        Some(nanoseconds) => Ok(1e-9 * nanoseconds as f64),
        None => quantity(part.trim(), Dimension::Time),
    };
    let times: Result<Vec<f64>, String> = text.split(',').map(time).collect();
    times.map(PassTimes).map_err(|why| {
        let wanted = "give a time for each pass, for example 0,6h,12h, or dates such as 2026-05-04T14:00:00Z";
        match why.is_empty() {
            true => wanted.to_owned(),
            false => format!("{why}; {wanted}"),
        }
    })
}

fn area(text: &str) -> Result<StableArea, String> {
    if let Ok(extent) = rectangle(text) {
        return Ok(StableArea::Rectangle(extent));
    }
    let numbers: Result<Vec<f64>, String> =
        text.split(',').map(|part| finite(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[x, y, radius_m]) if radius_m > 0.0 => Ok(StableArea::Disc {
            centre_m: [x, y],
            radius_m,
        }),
        _ => Err(
            "give ascending ranges of x and y, for example -5:5,20:30, or centre and radius, for example 0,25,5"
                .to_owned(),
        ),
    }
}
