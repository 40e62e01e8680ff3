//! `subap pair`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use subaperture::geometry::Geodetic;
use subaperture::units::Dimension;

use super::Writing;
use super::values::{any, finite, geodetic, odd, output, probability};

/// Options of `subap pair`.
#[derive(Debug, Group)]
#[command(
    after_help = "The phase is that of the image relative to the reference: a scatterer that recedes by d along the line of sight after the reference\n\
    has -4 pi d / wavelength. Images must be formed on the same surface; the surface has the phase 0."
)]
pub(crate) struct Pair {
    /// Complex image of the later pass: folder of a product, its image.json, complex64 .npy, SICD, GeoTIFF, or Zarr
    #[arg(value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) image: PathBuf,

    /// Complex image of the earlier pass, of the same formats; results are on its pixels
    #[arg(value_name = "REFERENCE", value_hint = ValueHint::AnyPath)]
    pub(crate) reference: PathBuf,

    /// Folder for pair.json, coherence.png, phase.png, change.png, and the formats of --format
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Window of the coherence, pixels: rows x columns, both odd, or one number for both
    #[arg(long, value_name = "ROWSxCOLUMNS", default_value = "7", value_parser = looks)]
    pub(crate) looks: PixelWindow,

    /// False-alarm probability of the change map, per pixel
    #[arg(long, value_name = "P", default_value_t = 1e-3, value_parser = probability)]
    pub(crate) pfa: f64,

    /// Coherence of the unchanged scene, 0 to 0.9999 [default: estimated from the median]
    #[arg(long, value_name = "D", value_parser = finite)]
    pub(crate) coherence: Option<f64>,

    /// Mean power of the stronger image, relative to the median, below which pixels are not tested, dB
    #[arg(long, value_name = "DB", default_value_t = -10.0, allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) floor: f64,

    /// Take the images as registered: estimate and remove no residual offset
    #[arg(long)]
    pub(crate) registered: bool,

    /// Position on the Earth of the scene's origin, x to the east, for an image that does not state it: degrees north and east,
    /// metres above the ellipsoid
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, value_parser = geodetic)]
    pub(crate) place: Option<Geodetic>,

    /// Write these too: cog (coherence.tif, interferogram.tif, change.tif), zarr (pair.zarr)
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

/// Formats of the results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PairFormat {
    /// Cloud-optimised GeoTIFF in UTM, by the nearest pixel
    Cog,
    /// Zarr group for xarray: both registered images, coherence, phase, change
    Zarr,
}

/// Rows and columns of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PixelWindow(pub(crate) [usize; 2]);

fn looks(text: &str) -> Result<PixelWindow, String> {
    let sides = match text.split_once('x') {
        Some((rows, columns)) => odd(rows).and_then(|rows| Ok([rows, odd(columns)?])),
        None => odd(text).map(|side| [side; 2]),
    };
    sides.map(PixelWindow).map_err(|_| {
        "give odd numbers of rows and columns from 3, such as 9x5, or one for both".to_owned()
    })
}
