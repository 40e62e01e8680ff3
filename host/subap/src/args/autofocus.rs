//! `subap autofocus`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use subaperture::autofocus::{Estimator, Goal, Measure, Unknown};
use subaperture::geometry::ImageGrid;
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::formers::FormerOptions;
use super::values::{above_zero, output, positive};
use super::{Input, Rehearsal, Writing};

/// `subap autofocus`.
#[derive(Debug, Group)]
#[command(
    after_help = "Phases that blur an image, and the image without them:\n  \
    subap autofocus a.cphd -o phase.csv --picture sharper.png\n  \
    subap focus a.cphd --phase phase.csv --out sharper"
)]
pub(crate) struct Autofocus {
    #[command(flatten)]
    pub(crate) input: Input,

    /// How: phase gradient, modified for near scenes, sharpness of patches, or drift of looks
    #[arg(long, short, value_enum, default_value_t)]
    pub(crate) method: Way,

    /// File for what was found: phases (pulse, phase_rad), which subap focus takes with --phase, or a track (time_s, x_m,
    /// y_m, z_m) [default: say what would be gained, and write nothing]
    #[arg(long, short, value_name = "CSV", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// File for a picture of the image before and after
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    /// Pixels that are to be sharp, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    #[command(flatten)]
    pub(crate) former: FormerOptions,

    /// What sharp means where a round is judged: entropy (many points), contrast, sharpness (few points) or peak
    #[arg(long, value_name = "MEASURE", default_value_t)]
    pub(crate) measure: Measure,

    /// Rounds at most
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    pub(crate) rounds: usize,

    /// Points looked at, at most, the brightest of their range bins [default: 64; 48 of mpga-image, 24 of sharpness]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) points: Option<usize>,

    /// How far below the brightest a point may be, dB [default: 30 of pga, else 25]
    #[arg(long, value_name = "DB", allow_negative_numbers = true, value_parser = above_zero(Dimension::Level))]
    pub(crate) within: Option<f64>,

    /// Of pga: how phases are estimated, eigenvector or gradient
    #[arg(long, value_name = "ESTIMATOR", default_value_t)]
    pub(crate) estimator: Estimator,

    /// Of sharpness: what is sought, phase or track
    #[arg(long, value_name = "WHAT", default_value_t)]
    pub(crate) unknown: Unknown,

    /// Of sharpness: what patches are sharpened by, sharpness or entropy
    #[arg(long, value_name = "GOAL", default_value_t)]
    pub(crate) goal: Goal,

    /// Of sharpness: pixels that a patch has along either side, more than a point is blurred over
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = positive)]
    pub(crate) patch_pixels: usize,

    /// Of map-drift: looks, two or more, and the degree of the polynomial that is found
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=16))]
    pub(crate) looks: u8,

    /// Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Window over slow time, across all pulses: as --window
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) slow_window: Window,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

impl Autofocus {
    /// Whether a track is found, and not phases.
    pub(crate) fn finds_track(&self) -> bool {
        match self.method {
            Way::MpgaImage => true,
            Way::Sharpness => self.unknown == Unknown::Track,
            Way::Pga | Way::MapDrift => false,
        }
    }
}

/// Methods of autofocus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Way {
    /// Phase gradient: a phase a pulse, alike for all of the scene
    #[default]
    Pga,
    /// Modified phase gradient: where the radar was, by points under different directions; for near scenes
    MpgaImage,
    /// Sharpness of backprojected patches over phases, or over the track
    Sharpness,
    /// Drift of looks of parts of the aperture: a polynomial of few terms
    MapDrift,
}
