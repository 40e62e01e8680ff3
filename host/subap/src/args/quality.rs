//! `subap quality`.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use serde::Deserialize;
use subaperture::geometry::Extent;
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::values::{At, above_zero, any, odd, output, place, rectangle};
use super::{Rehearsal, Writing};

/// `subap quality`.
#[derive(Debug, Group)]
#[command(mut_arg("dry_run", |dry_run| dry_run.requires("from")))]
pub(crate) struct Quality {
    /// Image: folder of a product (image.json and image.npy), its image.json, SICD, SIDD, GeoTIFF, Zarr, or complex64 .npy. An image without
    /// a grid is measured in pixels
    #[arg(value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) image: PathBuf,

    #[command(flatten)]
    pub(crate) points: Points,

    /// Recording from which the image was formed. Point responses are measured on finer chips formed from it, and theory uses the beam
    /// measured from the echoes. Repeat it for an image of several recordings, in the same order
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) from: Vec<PathBuf>,

    /// Image to compare with, of any format; it is related by its metadata
    #[arg(long, value_name = "OTHER", value_hint = ValueHint::AnyPath)]
    pub(crate) against: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) measuring: Measuring,

    /// Folder for pictures: cuts, chips, percent difference, coherence
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) plots: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Points whose responses are measured.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Points {
    /// Point to measure, as its position in the scene frame, metres (degrees and range on a polar grid; column and row of a .npy). The
    /// brightest pixel within 4 pixels is taken. May be repeated [default: the brightest]
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = place)]
    pub(crate) at: Vec<At>,
}

/// Settings of image measures other than point responses.
#[derive(Debug, Group)]
pub(crate) struct Measuring {
    /// Rectangle for the statistics, in x and y of the grid (as --at on polar grids and arrays). Over a dark rectangle the mean level is
    /// that of the noise [default: the whole image]
    #[arg(long, value_name = "X0:X1,Y0:Y1", allow_hyphen_values = true, value_parser = rectangle)]
    pub(crate) extent: Option<Extent>,

    /// Window over fast and slow time for which theory is computed [default: that of the product]
    #[arg(long, value_name = "W")]
    pub(crate) window: Option<Window>,

    /// Measure along and across this line of sight too: its angle from x towards y, degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = any(Dimension::Angle))]
    pub(crate) line_of_sight: Option<f64>,

    /// Level below the peak of --against, dB, under which pixels have no percent difference
    #[arg(long, value_name = "DB", default_value_t = 60.0, value_parser = above_zero(Dimension::Level))]
    pub(crate) floor: f64,

    /// Side of the coherence window, pixels, odd
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = odd)]
    pub(crate) coherence: usize,
}
