//! `subap gmti`.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use subaperture::focus::Numerics;
use subaperture::geometry::ImageGrid;
use subaperture::gmti::stanag4607;
use subaperture::units::Dimension;

use super::focus::numerics;
use super::values::{
    above_zero, error_bound, from_zero, output, positive, probability, several_channels,
};
use super::{SeveralChannels, Windows, Writing};

/// Default radar cross-section of the target whose minimum detectable velocity is stated, m^2.
pub(crate) const CROSS_SECTION_M2: f64 = 10.0;

/// Options of `subap gmti`.
#[derive(Debug, Group)]
#[command(after_help = "Detect movers, and show them over the image:\n  \
    subap gmti flight.cphd -o targets.geojson\n  \
    subap focus flight.cphd --out image\n  \
    subap view image --layer targets.geojson\n\n\
    The same with one pass over the recording, and less noise in the image:\n  \
    subap focus flight.cphd --gmti targets.geojson --out image\n\n\
    Focus a target under its own motion:\n  \
    subap focus flight.cphd --velocity 0,1.2 --out target\n\n\
    Compare the methods of detection in a simulated scenario:\n  \
    subap gmti --evaluate scenario.toml -o performance.html\n\n\
    Receivers must be apart along the track. A target appears in the image displaced along the track by range times radial\n\
    velocity over radar speed; its marked position is corrected by the velocity measured between the channels.")]
pub(crate) struct Gmti {
    /// Recording with pulse times and two or more channels along the track: CPHD 1.x, Gotcha GMTI challenge, or a description of raw samples (.toml). With --evaluate a scenario of subap simulate
    #[arg(value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(crate) input: PathBuf,

    /// Override a key of a description, such as radar.first_pulse=9.2s; or state receiver_offset=A,B,C or prf of the Gotcha GMTI challenge. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = super::setting)]
    pub(crate) set: Vec<(String, String)>,

    /// File for the targets: position, radial velocity, SNR and their errors, for subap view --layer. With --evaluate the page, HTML
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Simulate recordings of a scenario with random targets in place of its movers, and compare the methods of detection: probability of detection and of false alarm, minimum detectable
    /// velocity, against theory
    #[arg(long, conflicts_with_all = ["picture", "refocus", "stanag", "channels", "dwell"])]
    pub(crate) evaluate: bool,

    /// Number of simulated targets
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = positive, requires = "evaluate")]
    pub(crate) trials: usize,

    /// File for a picture of the image with numbered targets [default: that of the targets, ending in .png]
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    /// Refocus each target under its own motion at its place in the picture, not only mark it
    #[arg(long, conflicts_with = "dwell")]
    pub(crate) refocus: bool,

    /// File for the targets as a STANAG 4607 packet; needs --nationality, --platform and --exercise
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output(), requires_all = ["nationality", "platform", "exercise"])]
    pub(crate) stanag: Option<PathBuf>,

    /// Nationality in the packet, two letters
    #[arg(
        long,
        value_name = "XX",
        requires = "stanag",
        help_heading = "STANAG 4607"
    )]
    pub(crate) nationality: Option<String>,

    /// Platform ID in the packet, up to 10 characters
    #[arg(
        long,
        value_name = "ID",
        requires = "stanag",
        help_heading = "STANAG 4607"
    )]
    pub(crate) platform: Option<String>,

    /// Exercise indicator in the packet: origin of the data
    #[arg(long, value_enum, requires = "stanag", help_heading = "STANAG 4607")]
    pub(crate) exercise: Option<DataOrigin>,

    /// Channels to use: all, or a list such as T1R1,T1R2
    #[arg(long, value_name = "all|A,B", value_parser = several_channels, default_value = "all")]
    pub(crate) channels: SeveralChannels,

    /// Longest dwell, seconds: longer recordings are divided, and targets are tracked over dwells [default: the recording is one dwell]
    #[arg(long, value_name = "S", value_parser = above_zero(Dimension::Time))]
    pub(crate) dwell: Option<f64>,

    /// Sub-CPIs over which targets are integrated along their motion: also those fast along the track or outside of the grid in the image [default: detect
    /// in the image]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) sub_cpis: Option<usize>,

    /// Adjacent Doppler bins of a sub-CPI that are filtered together: 1, 3 or 5
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = positive, requires = "sub_cpis")]
    pub(crate) doppler_bins: usize,

    /// Largest speed of a target along the line of sight and across it, m/s
    #[arg(long, value_name = "M/S", default_value_t = 30.0, value_parser = above_zero(Dimension::Speed), requires = "sub_cpis")]
    pub(crate) max_speed: f64,

    /// Largest acceleration of a target along the line of sight, m/s^2
    #[arg(long, value_name = "M/S^2", default_value_t = 0.0, value_parser = from_zero(Dimension::Acceleration), requires = "sub_cpis")]
    pub(crate) max_acceleration: f64,

    /// Probability of a false alarm per resolution cell
    #[arg(long, value_name = "P", default_value_t = 1e-6, value_parser = probability)]
    pub(crate) false_alarms: f64,

    /// Radar cross-section, m^2, of the target whose minimum detectable velocity is stated, and mean of the simulated ones
    #[arg(long, value_name = "M2", default_value_t = CROSS_SECTION_M2, value_parser = above_zero(Dimension::CrossSection))]
    pub(crate) cross_section: f64,

    /// Cells on each side of a tested cell that are not used to estimate the clutter
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) guard: usize,

    /// Cells beyond the guard cells, on each side, that are used to estimate the clutter
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = positive)]
    pub(crate) training: usize,

    /// Pixels, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of each channel's image, in dB, -20 to -120: it limits the cancellation of clutter
    #[arg(long, value_name = "DB", default_value_t = -60.0, allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: f64,

    #[command(flatten)]
    pub(crate) windows: Windows,

    /// Use Fourier transforms with the same bits on every machine; they take two to four times as long
    #[arg(long)]
    pub(crate) portable: bool,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

impl Gmti {
    /// Numerics of the images.
    pub(crate) fn numerics(&self) -> Numerics<'static> {
        numerics(self.portable)
    }
}

/// Exercise indicator of a STANAG 4607 packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DataOrigin {
    /// Operation with real data
    OperationReal,
    /// Operation with simulated data
    OperationSimulated,
    /// Operation with synthesised data
    OperationSynthesized,
    /// Exercise with real data
    ExerciseReal,
    /// Exercise with simulated data
    ExerciseSimulated,
    /// Exercise with synthesised data
    ExerciseSynthesized,
}

impl From<DataOrigin> for stanag4607::Exercise {
    fn from(exercise: DataOrigin) -> Self {
        match exercise {
            DataOrigin::OperationReal => Self::OperationReal,
            DataOrigin::OperationSimulated => Self::OperationSimulated,
            DataOrigin::OperationSynthesized => Self::OperationSynthesized,
            DataOrigin::ExerciseReal => Self::ExerciseReal,
            DataOrigin::ExerciseSimulated => Self::ExerciseSimulated,
            DataOrigin::ExerciseSynthesized => Self::ExerciseSynthesized,
        }
    }
}
