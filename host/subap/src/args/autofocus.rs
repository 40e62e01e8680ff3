//! `subap autofocus`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use serde::Deserialize;
use subaperture::autofocus::{Estimator, Goal, Measure, Unknown};
use subaperture::geometry::ImageGrid;
use subaperture::units::Dimension;

use super::formers::FormerOptions;
use super::settings::{defaults, optional, parsed};
use super::values::{above_zero, one_of, output, positive};
use super::{Input, Rehearsal, Windows, Writing};

/// `subap autofocus`.
#[derive(Debug, Group)]
#[command(
    after_help = "Estimate phase errors, and form the image without them:\n  \
    subap autofocus a.cphd -o phase.csv --picture both.png\n  \
    subap focus a.cphd --phase phase.csv --out corrected"
)]
pub(crate) struct Autofocus {
    #[command(flatten)]
    pub(crate) input: Input,

    #[command(flatten)]
    pub(crate) settings: AutofocusSettings,

    /// Output file: phases (pulse, phase_rad) for subap focus --phase, or a track (time_s, x_m, y_m, z_m) for --track; zero phases or
    /// the recorded track if the correction is refused [default: print the figures, write nothing]
    #[arg(long, short, value_name = "CSV", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// Picture of the image before and after
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) former: FormerOptions,

    #[command(flatten)]
    pub(crate) windows: Windows,

    /// Keep a correction that held-out data cannot judge, for bright points lie in too few range cells [default: refuse it]
    #[arg(long)]
    pub(crate) keep_unjudged: bool,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

/// Method of autofocus and its settings.
#[derive(Clone, Debug, Group, Deserialize)]
#[serde(default)]
pub(crate) struct AutofocusSettings {
    /// Method
    #[arg(long, short, value_enum, default_value_t)]
    pub(crate) method: Method,

    /// Image grid of the estimate, as for focus; it may have fewer pixels than the image [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    #[serde(deserialize_with = "optional")]
    pub(crate) grid: Option<ImageGrid>,

    /// Sharpness measure of rounds and held-out data: entropy (many points), contrast, sharpness (few points) or peak
    #[arg(long, value_name = "MEASURE", default_value_t, value_parser = one_of::<Measure>(&["entropy", "contrast", "sharpness", "peak"]))]
    #[serde(deserialize_with = "parsed")]
    pub(crate) measure: Measure,

    /// Largest number of rounds
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    pub(crate) rounds: usize,

    /// Largest number of points, the brightest of their range bins [default: 64; 48 of mpga-image, 24 of sharpness]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) points: Option<usize>,

    /// Lowest level of a point below the brightest, dB [default: 30 of pga, else 25]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = above_zero(Dimension::Level))]
    pub(crate) within: Option<f64>,

    /// pga: phase estimator: likelihood (all range cells; points, texture, clutter), eigenvector (bright points; wide angles, near
    /// scenes) or gradient (bright points of high signal-to-noise ratio)
    #[arg(long, value_name = "ESTIMATOR", default_value_t, value_parser = one_of::<Estimator>(&["likelihood", "eigenvector", "gradient"]))]
    #[serde(deserialize_with = "parsed")]
    pub(crate) estimator: Estimator,

    /// sharpness: unknown, phase or track
    #[arg(long, value_name = "WHAT", default_value_t, value_parser = one_of::<Unknown>(&["phase", "track"]))]
    #[serde(deserialize_with = "parsed")]
    pub(crate) unknown: Unknown,

    /// sharpness: objective of the patches, sharpness or entropy
    #[arg(long, value_name = "GOAL", default_value_t, value_parser = one_of::<Goal>(&["sharpness", "entropy"]))]
    #[serde(deserialize_with = "parsed")]
    pub(crate) goal: Goal,

    /// sharpness: side of a patch, pixels; more than the blur of a point
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = positive)]
    pub(crate) patch_pixels: usize,

    /// map-drift: number of sub-aperture looks, which is the degree of the polynomial
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=16))]
    pub(crate) looks: u8,
}

impl Default for AutofocusSettings {
    fn default() -> Self {
        defaults()
    }
}

impl AutofocusSettings {
    /// Whether the method estimates a track instead of phases.
    pub(crate) fn finds_track(&self) -> bool {
        match self.method {
            Method::MpgaImage => true,
            Method::Sharpness => self.unknown == Unknown::Track,
            Method::Pga | Method::MapDrift => false,
        }
    }
}

/// Methods of autofocus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Method {
    /// Phase gradient autofocus: a phase per pulse, common to the scene
    #[default]
    Pga,
    /// Modified phase gradient autofocus: the track, from points in different directions; for near scenes
    MpgaImage,
    /// Maximum sharpness or minimum entropy of patches, over phases or the track
    Sharpness,
    /// Map drift between sub-aperture looks: a phase polynomial
    MapDrift,
}
