//! `subap track`.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args as Group, ValueHint};
use subaperture::signal::window::Window;

use super::values::{any, output, positive, ranges, several_channels};
use super::{Logs, SeveralChannels, Writing};
use subaperture::units::Dimension;

/// `subap track`.
#[derive(Debug, Group)]
#[command(after_help = "Form an image on the estimated track:\n  \
    subap track walk.cphd -o track.csv\n  \
    subap focus walk.cphd --track track.csv --out image\n\n\
    Estimate the track from echoes and a navigation log:\n  \
    subap track walk.cphd --navigation receiver.log -o track.csv\n\n\
    Moving targets are excluded from the track estimate and reported with their velocities. A track that contradicts its\n\
    residuals is refused; a doubtful one is written, and the exit status is 3.")]
pub(crate) struct Track {
    /// Recording: CPHD 1.x with several channels, or a description of raw samples (.toml); at least two receivers, at most half a wavelength
    /// apart
    #[arg(value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(crate) input: PathBuf,

    /// Override a key of a description, such as radar.first_pulse=9.2s. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = super::setting)]
    pub(crate) set: Vec<(String, String)>,

    /// File for the track: time, position, attitude, covariance and residual of every pulse, for subap focus --track
    #[arg(long, short, value_name = "CSV", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// File for a picture of track and targets [default: the track's, ending in .png]
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) tracking: Tracking,

    #[command(flatten)]
    pub(crate) logs: Logs,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Settings of the track estimate.
#[derive(Debug, Group)]
pub(crate) struct Tracking {
    /// Channels to use: all, or a list such as T1R1,T1R2
    #[arg(long, value_name = "all|A,B", value_parser = several_channels, default_value = "all")]
    pub(crate) channels: SeveralChannels,

    /// Nearest and farthest range searched for targets, as 2m:30m [default: the whole unambiguous interval]
    #[arg(long, value_name = "NEAR:FAR", value_parser = ranges)]
    pub(crate) range: Option<(f64, f64)>,

    /// Largest number of targets per pulse, the strongest first
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    pub(crate) targets: usize,

    /// Least signal-to-noise ratio of an echo in every channel, dB
    #[arg(long, value_name = "DB", default_value_t = 10.0, allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) least_snr: f64,

    /// Largest number of pulses in a row in which a target may be missed
    #[arg(long, value_name = "N", default_value_t = 30)]
    pub(crate) bridge: usize,

    /// Window over frequency: none, taylor, taylor:DB, hamming or kaiser:BETA; its side lobes mask weak targets near
    /// strong ones
    #[arg(long, value_name = "W", default_value = "taylor:50")]
    pub(crate) window: Window,
}

/// Source of the track of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum TrackSource {
    /// Estimated from the recording's own echoes.
    Echoes,
    /// Estimated from echoes and navigation.
    Fused,
    /// Positions of the navigation logs, without the echoes.
    Navigation,
    /// Read from a file.
    File(PathBuf),
}

impl TrackSource {
    /// The file, if it is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Echoes | Self::Fused | Self::Navigation => None,
        }
    }
}

impl fmt::Display for TrackSource {
    /// Text of the option.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Echoes => f.write_str("mpga"),
            Self::Fused => f.write_str("fused"),
            Self::Navigation => f.write_str("navigation"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// A file of any name but these three (`./mpga` is a file).
pub(super) fn track_source() -> impl TypedValueParser<Value = TrackSource> {
    PathBufValueParser::new().map(|path| match path.to_str() {
        Some("mpga") => TrackSource::Echoes,
        Some("fused") => TrackSource::Fused,
        Some("navigation") => TrackSource::Navigation,
        _ => TrackSource::File(path),
    })
}
