//! `subap focus` and `subap velocity`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as Group, ValueEnum, ValueHint};
use glam::DVec3;
use serde::{Deserialize, Deserializer};
use subaperture::focus::beam::AntennaWeights;
use subaperture::focus::{BoundPolicy, Numerics, TimeModel};
use subaperture::geometry::Axis;
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::formers::{self, FormerOptions};
use super::logs::Logs;
use super::settings::{defaults, optional, parsed, parsed_by};
use super::track::{TrackSource, track_source};
use super::values::{above_zero, any, axis, error_bound, output, positive, scratch_size, vector};
use super::{GridSettings, Input, Look, Producing, Rehearsal, Tiled, Writing};

/// `subap focus`.
#[derive(Debug, Group)]
#[command(
    mut_arg("files", |files| files.required(false).required_unless_present("from_maps")),
    mut_arg("from_maps", |maps| maps.conflicts_with_all(formers::ids_but_the_bound())),
    mut_arg("plan", |plan| plan.conflicts_with_all(formers::ids())),
)]
pub(crate) struct Focus {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Form the image from the maps of an embedded module instead of a recording
    #[arg(long, value_name = "MAPS", value_hint = ValueHint::FilePath, conflicts_with_all = [
        "files", "channel", "channels", "set", "velocity", "motion", "surface", "geoid", "troposphere", "track", "phase", "window", "slow_window", "beam", "squint", "doppler_band", "doppler_centroid", "antenna_weights", "scratch", "check", "portable",
        "model", "device"
    ])]
    pub(crate) from_maps: Option<PathBuf>,

    /// Folder for image.npy, image.json and image.png
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) image: Imaging,

    #[command(flatten)]
    pub(crate) target: TargetMotion,

    /// Track that replaces the recorded positions: a file from subap track, with positions and attitudes of the body whose origin is the
    /// middle of the antennas and whose x axis lies along the receivers; mpga, estimated from the recording's own echoes with the defaults
    /// of subap track; fused, estimated from the echoes and navigation (the recorded positions, or the logs of --navigation); or navigation,
    /// the logs of --navigation alone
    #[arg(long, value_name = "CSV|mpga|fused|navigation", value_hint = ValueHint::FilePath, value_parser = track_source(),
        conflicts_with_all = ["tiled", "plan", "tiles", "resume"])]
    pub(crate) track: Option<TrackSource>,

    #[command(flatten)]
    pub(crate) logs: Logs,

    /// Phase error of each pulse to be removed first: a file from subap autofocus
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath,
        conflicts_with_all = ["tiled", "plan", "tiles", "resume"])]
    pub(crate) phase: Option<PathBuf>,

    /// Detect moving targets as subap gmti does with its defaults, and write them to this file: each channel (all, or those of --channels) is focused
    /// once, and the image is the mean of the registered channels. Needs a recording of two or more channels along the track
    #[arg(long, value_name = "GEOJSON", value_hint = ValueHint::FilePath, value_parser = output(), conflicts_with_all = [
        "from_maps", "channel", "velocity", "motion", "surface", "geoid", "troposphere", "track", "navigation", "phase", "allow_error", "beam", "squint", "doppler_band", "doppler_centroid", "antenna_weights", "scratch", "check",
        "tiled", "resume", "plan", "tiles", "dry_run"
    ])]
    pub(crate) gmti: Option<PathBuf>,

    /// Form N pixels, chosen by a fixed seed, by the exact sum too, and report the error of the image
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) check: Option<usize>,

    /// Device that forms the image. bp and rdbp on Cartesian grids can use a GPU; a note reports an image formed on the processor all the same
    #[arg(long, value_enum, default_value_t = DeviceChoice::Cpu, conflicts_with = "portable")]
    pub(crate) device: DeviceChoice,

    #[command(flatten)]
    pub(crate) tiled: Tiled,

    #[command(flatten)]
    pub(crate) look: Look,

    #[command(flatten)]
    pub(crate) producing: Producing,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

/// Device that forms an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DeviceChoice {
    /// The processor, without a GPU
    Cpu,
    /// A GPU by Vulkan or Metal, or a driver of these on the processor; needs the feature gpu
    Gpu,
    /// A GPU if there is one, else the processor
    #[value(name = "auto")]
    Automatic,
}

/// Azimuth beam of the antenna.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BeamWidth {
    /// Full width, radians.
    Given(f64),
    /// From the Doppler spectrum.
    Estimated,
    /// All pulses form all pixels.
    None,
}

impl fmt::Display for BeamWidth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Given(width_rad) => write!(f, "{} deg", width_rad.to_degrees()),
            Self::Estimated => f.write_str("auto"),
            Self::None => f.write_str("none"),
        }
    }
}

/// Weights of pulses by antenna patterns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum AntennaWeighting {
    /// Antenna patterns have no effect on weights
    #[default]
    None,
    /// Matched filter over the pulses, and pixels normalised by the response of a point scatterer
    Matched,
}

impl From<AntennaWeighting> for AntennaWeights {
    fn from(weighting: AntennaWeighting) -> Self {
        match weighting {
            AntennaWeighting::None => Self::None,
            AntennaWeighting::Matched => Self::Matched,
        }
    }
}

impl FromStr for BeamWidth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Estimated),
            "none" => Ok(Self::None),
            angle => {
                let degrees = above_zero(Dimension::Angle)(angle)
                    .map_err(|error| format!("{error}; or auto, or none"))?;
                Ok(Self::Given(degrees.to_radians()))
            }
        }
    }
}

/// Windows over fast and slow time.
#[derive(Clone, Copy, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Windows {
    /// Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    #[serde(deserialize_with = "parsed")]
    pub(crate) window: Window,

    /// Window over slow time, across all pulses: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    #[serde(deserialize_with = "parsed")]
    pub(crate) slow_window: Window,
}

impl Windows {
    /// Windows over fast and slow time.
    pub(crate) fn both(&self) -> [Window; 2] {
        [self.window, self.slow_window]
    }
}

/// Image former and the settings of its images, except for the grid.
#[derive(Clone, Debug, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Forming {
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) former: FormerOptions,

    /// Write the image even if its predicted error exceeds the bound. The record states it, and the exit status is 3. Implied if an
    /// algorithm is named or no bound is given
    #[arg(long)]
    pub(crate) allow_error: bool,

    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) windows: Windows,

    /// Full width of the antenna's azimuth beam, degrees. Each pixel is formed from the pulses that illuminate it, which avoids azimuth
    /// ambiguities. auto estimates it from the azimuth Doppler spectrum; none uses all pulses for all pixels [default: the beam stated by the
    /// recording; else auto where the pulse spacing undersamples the Doppler extent and the spectrum clearly shows a beam]
    #[arg(long, value_name = "DEG|auto|none")]
    #[serde(deserialize_with = "optional")]
    pub(crate) beam: Option<BeamWidth>,

    /// Squint of the beam's middle forward of broadside, degrees; negative is backward. For an estimated beam, its approximate value
    /// [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = any(Dimension::Angle), requires = "beam")]
    #[serde(deserialize_with = "angle_of_job")]
    pub(crate) squint: Option<f64>,

    /// Processed Doppler bandwidth, hertz, in place of the whole beam. Azimuth ambiguities are suppressed where it is less than the pulse repetition
    /// frequency
    #[arg(long, value_name = "HZ", value_parser = above_zero(Dimension::Frequency), conflicts_with = "beam")]
    pub(crate) doppler_band: Option<f64>,

    /// Doppler centroid of the processed band, hertz; negative is backward [default: the middle of the beam stated by the recording; else estimated
    /// from the azimuth Doppler spectrum]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = any(Dimension::Frequency), requires = "doppler_band")]
    pub(crate) doppler_centroid: Option<f64>,

    /// Weights of pulses by the recording's antenna patterns. A point scatterer then reads its amplitude anywhere in the beam. The patterns
    /// select the pulses of each pixel unless --beam or --doppler-band is given
    #[arg(long, value_enum, value_name = "WEIGHTS", default_value_t)]
    pub(crate) antenna_weights: AntennaWeighting,

    /// Use Fourier transforms with the same bits on every machine; they take two to four times as long
    #[arg(long)]
    pub(crate) portable: bool,

    /// Memory for tables and buffers of one thread, which a plan depends on: that of the smallest machine that executes it [default:
    /// 48M]
    #[arg(long, value_name = "SIZE", value_parser = scratch_size, help_heading = "Tiles")]
    #[serde(deserialize_with = "scratch_of_job")]
    pub(crate) scratch: Option<u64>,
}

impl Default for Forming {
    fn default() -> Self {
        defaults()
    }
}

/// Angles of a job are in radians, those of options in degrees.
fn angle_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Ok(Some(f64::deserialize(from)?.to_degrees()))
}

fn scratch_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
    parsed_by(from, scratch_size).map(Some)
}

/// Motion of the target.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct TargetMotion {
    /// Focus targets of this velocity, m/s; pixels are positions at the first pulse [default: stationary]
    #[arg(long, value_name = "VX,VY[,VZ]", allow_hyphen_values = true, value_parser = vector(Dimension::Speed))]
    pub(crate) velocity: Option<DVec3>,

    /// Focus targets that move as in this file: columns time_s, x_m, y_m, z_m over the time of all pulses; pixels are positions at the
    /// first pulse [default: stationary]
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath, conflicts_with = "velocity")]
    pub(crate) motion: Option<PathBuf>,
}

/// Settings that determine the pixels of an image of a recording: the input of a plan.
#[derive(Debug, Group)]
pub(crate) struct Imaging {
    #[command(flatten)]
    pub(crate) forming: Forming,

    #[command(flatten)]
    pub(crate) grid: GridSettings,

    /// Timing model that plans are chosen by, as subap plan calibrate measures it on a machine [default: a fixed one, so that every
    /// machine makes the same plan]
    #[arg(long, value_name = "MODEL", value_hint = ValueHint::FilePath, help_heading = "Tiles")]
    pub(crate) model: Option<PathBuf>,
}

impl Forming {
    /// Whether an image may exceed the error bound: if the user allows it or names a former, or if the bound is the default.
    pub(crate) fn bound_policy(&self) -> BoundPolicy {
        let former = &self.former;
        match self.allow_error || former.is_named() || !former.has_bound() {
            true => BoundPolicy::Allowed,
            false => BoundPolicy::Refused,
        }
    }

    /// Numerics with the timing model that was read, if any.
    pub(crate) fn numerics<'m>(&self, model: Option<&'m TimeModel>) -> Numerics<'m> {
        let numerics = numerics(self.portable);
        let model = model.unwrap_or(numerics.model);
        Numerics { model, ..numerics }
    }
}

/// Numerics with or without `--portable`.
pub(super) fn numerics<'m>(portable: bool) -> Numerics<'m> {
    match portable {
        true => Numerics::default().portable(),
        false => Numerics::default(),
    }
}

/// `subap velocity`.
#[derive(Debug, Group)]
pub(crate) struct Velocity {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Position of the target at the first pulse, metres in the scene frame
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) at: DVec3,

    /// Velocities along x, m/s, stop excluded [default: the unambiguous interval about 0 in steps of half the resolution, at most 128 steps]
    #[arg(long, value_name = "START:STOP:STEP", allow_hyphen_values = true, value_parser = axis(Dimension::Speed))]
    pub(crate) vx: Option<Axis>,

    /// Velocities along y, m/s, stop excluded [default: as for --vx]
    #[arg(long, value_name = "START:STOP:STEP", allow_hyphen_values = true, value_parser = axis(Dimension::Speed))]
    pub(crate) vy: Option<Axis>,

    /// Velocity along z, m/s
    #[arg(long, value_name = "M/S", default_value_t = 0.0, allow_hyphen_values = true, value_parser = any(Dimension::Speed))]
    pub(crate) vz: f64,

    /// Folder for image.npy, image.json and image.png
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Bound on the relative RMS error against the exact sum, in dB, -20 to -120 [default: -60]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    #[command(flatten)]
    pub(crate) windows: Windows,

    /// Use Fourier transforms with the same bits on every machine; they take two to four times as long
    #[arg(long)]
    pub(crate) portable: bool,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

impl Velocity {
    /// Numerics of the image.
    pub(crate) fn numerics(&self) -> Numerics<'static> {
        numerics(self.portable)
    }
}
