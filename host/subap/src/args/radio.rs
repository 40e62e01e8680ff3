//! `subap capture`, `subap radio` and `subap profile`.

use std::path::PathBuf;

use clap::{Args as Group, Subcommand, ValueHint};
use glam::DVec3;
use subaperture::geometry::{Extent, Geodetic};
use subaperture::radio::experiment;
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::values::{above_zero, any, finite, output, positive, rectangle, setting, vector};
use super::watching::Watching;
use super::{Rehearsal, Writing};

/// `subap capture`.
#[derive(Debug, Group)]
#[command(after_help = "First steps, without a radio:\n  \
    subap capture --example thesis-scene > scene.toml\n  \
    subap capture --example thesis > thesis.toml\n  \
    subap capture thesis.toml -o walk\n  \
    subap profile walk.sigmf-meta --out profiles\n\n\
    Ctrl-C ends a capture; what was recorded by then is whole (exit status 130, or 0 where plan.sweeps = 0). Where the radio\n\
    fails or the disk is full it is whole too, and the exit status 1.")]
pub(crate) struct Capture {
    /// The experiment, in TOML: see --keys and --example
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath,
        required_unless_present_any = ["keys", "example"])]
    pub(crate) experiment: Option<PathBuf>,

    /// Name of the recording; .sigmf-data and .sigmf-meta are added, and nothing is written over [default:
    /// files.recording of the experiment]
    #[arg(long, short, value_name = "NAME", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// In place of the experiment's radio: a recording, received again
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) replay: Option<PathBuf>,

    /// Override a key of the experiment, as plan.sweeps=100; any number of times
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Print every key of an experiment with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["experiment", "example", "out", "replay"])]
    pub(crate) keys: bool,

    /// Print an experiment, or a scene for one, to start from
    #[arg(long, value_name = "NAME", conflicts_with_all = ["experiment", "out", "replay"],
        value_parser = clap::builder::PossibleValuesParser::new(experiment::examples::names()))]
    pub(crate) example: Option<String>,

    /// Show the range profile, levels and losses while it captures, where standard error is a terminal
    #[arg(long)]
    pub(crate) live: bool,

    #[command(flatten)]
    pub(crate) watching: Watching,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

/// `subap radio`.
#[derive(Debug, Group)]
pub(crate) struct Radio {
    #[command(subcommand)]
    pub(crate) task: RadioTask,
}

/// What to do with a radio.
#[derive(Debug, Subcommand)]
pub(crate) enum RadioTask {
    /// The radios that are connected; needs a subap built with the feature uhd
    List(RadioList),
    /// What an experiment's radio can do, what it was set to, and its sensors
    Probe(Probe),
    /// Find what cables and channels do, of a capture of the sky and one with a reflector, for subap profile
    Calibrate(Calibrate),
    /// Make a capture phase history, CPHD, on the track of what carried the antennas
    Convert(Convert),
}

/// `subap radio list`.
#[derive(Debug, Group)]
pub(crate) struct RadioList {
    /// Only the one of this serial number
    #[arg(long, value_name = "SERIAL")]
    pub(crate) serial: Option<String>,
}

/// `subap radio probe`.
#[derive(Debug, Group)]
pub(crate) struct Probe {
    /// The experiment, as for subap capture
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath)]
    pub(crate) experiment: PathBuf,

    /// Override a key of the experiment, as device.serial=30A1B2C; any number of times
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,
}

/// `subap radio calibrate`.
#[derive(Debug, Group)]
pub(crate) struct Calibrate {
    /// Capture of nothing but the sky: what the antennas hear of each other
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) sky: PathBuf,

    /// Capture by the same set-up, with one reflector that is stronger than all else near it
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) reflector: PathBuf,

    /// With a loop: the reflector's range by tape, from where ranges are to count, metres
    #[arg(long, value_name = "METRES", value_parser = above_zero(Dimension::Length), required_unless_present = "at")]
    pub(crate) range: Option<f64>,

    /// With the leakage as the reference: the reflector's place in the axes of the section antennas, metres
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector(Dimension::Length), conflicts_with = "range")]
    pub(crate) at: Option<DVec3>,

    /// How far from there cables may show it, metres
    #[arg(long, value_name = "METRES", default_value_t = 5.0, value_parser = above_zero(Dimension::Length))]
    pub(crate) search: f64,

    /// Sweep of both captures that is taken
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) sweep: u64,

    /// File for the calibration
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap profile`.
#[derive(Debug, Group)]
pub(crate) struct Profile {
    /// The capture, by any of its files
    #[arg(value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) recording: PathBuf,

    /// Sweep whose profile is told and drawn
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) sweep: u64,

    /// What cables and channels do: a file of subap radio calibrate
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) calibration: Option<PathBuf>,

    /// Receiver whose antenna is shown: 1, or 0 too where the leakage is the reference
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) receiver: usize,

    /// Window over carriers: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Beyond this nothing reflects, metres: by that carriers that are missing are filled [default: three quarters of
    /// the unambiguous range]
    #[arg(long, value_name = "METRES", value_parser = above_zero(Dimension::Length))]
    pub(crate) reach: Option<f64>,

    /// Peaks so far below the strongest are not told, dB
    #[arg(long, value_name = "DB", default_value_t = 25.0, value_parser = above_zero(Dimension::Level))]
    pub(crate) floor: f64,

    /// Places a resolution cell
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    pub(crate) fineness: usize,

    /// Refer to nothing but the tone as it was sent: shows that there is no profile without the reference
    #[arg(long, conflicts_with = "calibration")]
    pub(crate) no_reference: bool,

    /// Folder for pictures: profile.png, and of several sweeps waterfall.png
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap radio convert`.
#[derive(Debug, Group)]
pub(crate) struct Convert {
    /// The capture, by any of its files
    #[arg(value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) recording: PathBuf,

    /// CPHD file to write; a receiver is a channel
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Track of what carried the antennas, as subap focus --track takes it [default: it stood at the origin, or its way
    /// is not known]
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(crate) track: Option<PathBuf>,

    /// The radio's time at the track's time 0, seconds
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, default_value_t = 0.0, requires = "track",
        value_parser = any(Dimension::Time))]
    pub(crate) zero: f64,

    /// The scene's middle, to which phases are referred, metres
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) reference: DVec3,

    /// Where on the Earth the scene's origin is, degrees and metres; x is east there, y north, z up
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, default_value = "0,0,0", value_parser = origin)]
    pub(crate) origin: Geodetic,

    /// The part of the scene that is looked at: what motion within a sweep leaves is bounded over it
    #[arg(long, value_name = "X0:X1,Y0:Y1", allow_hyphen_values = true, value_parser = rectangle)]
    pub(crate) extent: Option<Extent>,

    /// What cables and channels do: a file of subap radio calibrate
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) calibration: Option<PathBuf>,

    /// Beyond this nothing reflects, metres [default: as subap profile]
    #[arg(long, value_name = "METRES", value_parser = above_zero(Dimension::Length))]
    pub(crate) reach: Option<f64>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `47.37,8.54` or `47.37,8.54,408`.
fn origin(text: &str) -> Result<Geodetic, String> {
    let numbers: Result<Vec<f64>, String> =
        text.split(',').map(|part| finite(part.trim())).collect();
    let (latitude_deg, longitude_deg, height_m) = match numbers.as_deref() {
        Ok(&[latitude, longitude]) => (latitude, longitude, 0.0),
        Ok(&[latitude, longitude, height_m]) => (latitude, longitude, height_m),
        _ => {
            return Err(
                "give degrees north and east, and metres, for example 47.37,8.54,408".to_owned(),
            );
        }
    };
    let within = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 && height_m.abs() < 1e6;
    within
        .then_some(Geodetic {
            latitude_deg,
            longitude_deg,
            height_m,
        })
        .ok_or_else(|| {
            "latitudes are -90 to 90 degrees, longitudes -180 to 180, heights less than 1000 km"
                .to_owned()
        })
}
