//! `subap capture`, `subap radio` and `subap profile`.

use std::path::PathBuf;

use clap::{Args as Group, Subcommand, ValueHint};
use glam::DVec3;
use subaperture::geometry::{Extent, Geodetic};
use subaperture::module::link::ModuleAddress;
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
    With a vector network analyser, see subap capture --example vna.\n\n\
    Ctrl-C ends a capture; the recording up to then is complete (exit status 130, or 0 if plan.sweeps = 0). If the radio\n\
    fails or the disk is full, the recording is complete too, and the exit status is 1.")]
pub(crate) struct Capture {
    /// Experiment in TOML; see --keys and --example
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath,
        required_unless_present_any = ["keys", "example"])]
    pub(crate) experiment: Option<PathBuf>,

    /// Name of the recording, to which .sigmf-data and .sigmf-meta are added; existing files are not replaced. With a network analyser, its
    /// folder, where an interrupted capture continues [default: files.recording of the experiment]
    #[arg(long, short, value_name = "NAME", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// Recording to replay in place of the radio
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) replay: Option<PathBuf>,

    /// Override a key of the experiment, such as plan.sweeps=100. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Print every key of an experiment with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["experiment", "example", "out", "replay"])]
    pub(crate) keys: bool,

    /// Print an example experiment or scene
    #[arg(long, value_name = "NAME", conflicts_with_all = ["experiment", "out", "replay"],
        value_parser = clap::builder::PossibleValuesParser::new(experiment::examples::names()))]
    pub(crate) example: Option<String>,

    /// Send each sweep to an embedded module during the capture: tcp://HOST:PORT, serial:/dev/ttyX@BAUD, emulate:float or
    /// emulate:fixed. Its range profiles, their record and a waterfall, updated about once a second, go to --profiles
    #[arg(long, value_name = "WHERE", requires = "profiles")]
    pub(crate) module: Option<ModuleAddress>,

    /// Folder for the range profiles of the module
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output(), requires = "module")]
    pub(crate) profiles: Option<PathBuf>,

    /// Firmware to emulate [default: target/module/float or fixed, here or above]
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath, requires = "module")]
    pub(crate) firmware: Option<PathBuf>,

    /// Show range profile, levels and lost samples during the capture, if standard error is a terminal
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

/// Task for a radio.
#[derive(Debug, Subcommand)]
pub(crate) enum RadioTask {
    /// List connected radios; needs a subap built with the feature uhd
    List(RadioList),
    /// Print capabilities, settings and sensors of an experiment's radio
    Probe(Probe),
    /// Test an experiment's radio with the transmitter looped back, and report measured values with limits
    Selftest(RadioSelftest),
    /// Calibrate cables and channels from captures of the sky and of a reflector, for subap profile
    Calibrate(Calibrate),
    /// Convert a capture to phase history (CPHD) with the track of the antennas
    Convert(Convert),
}

/// `subap radio list`.
#[derive(Debug, Group)]
pub(crate) struct RadioList {
    /// Serial number of the radio [default: all radios]
    #[arg(long, value_name = "SERIAL")]
    pub(crate) serial: Option<String>,
}

/// `subap radio probe`.
#[derive(Debug, Group)]
pub(crate) struct Probe {
    /// Experiment, as for subap capture
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath)]
    pub(crate) experiment: PathBuf,

    /// Override a key of the experiment, such as device.serial=30A1B2C. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,
}

/// Arguments of `subap radio selftest`.
#[derive(Debug, Group)]
#[command(
    after_help = "Connect the transmitter, through an attenuator and a splitter, to both receivers. The exit status is 1 if a check failed.\n\
    The report (--out) is one JSON file to send to the developers; it names the device's serial number."
)]
pub(crate) struct RadioSelftest {
    /// Experiment, as for subap capture
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath)]
    pub(crate) experiment: PathBuf,

    /// Override a key of the experiment, such as device.serial=30A1B2C. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Duration of the streaming test, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = above_zero(Dimension::Time))]
    pub(crate) stream: f64,

    /// Expected delay of receiver 1 minus that of receiver 0, seconds [default: any]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = any(Dimension::Time))]
    pub(crate) delay: Option<f64>,

    /// File for the report, JSON
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap radio calibrate`.
#[derive(Debug, Group)]
pub(crate) struct Calibrate {
    /// Capture of the empty sky, which measures the coupling of the antennas
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) sky: PathBuf,

    /// Capture with the same set-up of one or more reflectors, stronger than all other echoes near them
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) reflector: PathBuf,

    /// Reflector's surveyed range from the range origin, metres; for a loop as the reference. Repeated for each reflector
    #[arg(long, value_name = "METRES", value_parser = above_zero(Dimension::Length), required_unless_present = "at")]
    pub(crate) range: Vec<f64>,

    /// Reflector's position in the axes of the section antennas, metres; for the leakage as the reference. Repeated for each reflector
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector(Dimension::Length), conflicts_with = "range")]
    pub(crate) at: Vec<DVec3>,

    /// Largest range offset of the reflectors by cables, metres
    #[arg(long, value_name = "METRES", default_value_t = 5.0, value_parser = above_zero(Dimension::Length))]
    pub(crate) search: f64,

    /// Sweep of both captures to use, from 0
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
    /// Capture, by any of its files
    #[arg(value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) recording: PathBuf,

    /// Sweep whose profile is printed and drawn, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) sweep: u64,

    /// Calibration file of subap radio calibrate [default: none]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) calibration: Option<PathBuf>,

    /// Receiver to show: 1, or also 0 if the leakage is the reference
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) receiver: usize,

    /// Window over carriers: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Largest range of echoes, metres; used to fill missing carriers [default: that of a plan of chirps, or three quarters of the unambiguous range]
    #[arg(long, value_name = "METRES", value_parser = above_zero(Dimension::Length))]
    pub(crate) reach: Option<f64>,

    /// Lowest level of printed scatterers below the strongest, dB. Their ranges are estimated together, with their standard deviations by noise
    #[arg(long, value_name = "DB", default_value_t = 25.0, value_parser = above_zero(Dimension::Level))]
    pub(crate) floor: f64,

    /// Range samples per resolution cell
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = positive)]
    pub(crate) fineness: usize,

    /// Use the transmitted tone as the only reference, which shows that there is no profile without the reference channel
    #[arg(long, conflicts_with = "calibration")]
    pub(crate) no_reference: bool,

    /// Folder for pictures: profile.png, and waterfall.png for several sweeps
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap radio convert`.
#[derive(Debug, Group)]
pub(crate) struct Convert {
    /// Capture, by any of its files
    #[arg(value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) recording: PathBuf,

    /// CPHD file to write; each receiver is a channel
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Track of the platform, as for subap focus --track [default: at rest at the origin, or unknown]
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(crate) track: Option<PathBuf>,

    /// Time of the radio at time 0 of the track, seconds
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, default_value_t = 0.0, requires = "track",
        value_parser = any(Dimension::Time))]
    pub(crate) zero: f64,

    /// Scene reference point of the phases, metres
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) reference: DVec3,

    /// Position on the Earth of the scene's origin, degrees and metres; x is east, y north, z up
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, default_value = "0,0,0", value_parser = origin)]
    pub(crate) origin: Geodetic,

    /// Part of the scene over which the residual of intra-sweep motion is bounded
    #[arg(long, value_name = "X0:X1,Y0:Y1", allow_hyphen_values = true, value_parser = rectangle)]
    pub(crate) extent: Option<Extent>,

    /// Calibration file of subap radio calibrate [default: none]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) calibration: Option<PathBuf>,

    /// Largest range of echoes, metres [default: as for subap profile]
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
