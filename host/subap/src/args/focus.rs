//! `subap focus` and `subap velocity`.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use glam::DVec3;
use subaperture::focus::{BoundPolicy, Numerics, TimeModel};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::formers::{self, FormerOptions};
use super::logs::Logs;
use super::track::{TrackSource, track_source};
use super::values::{above_zero, any, axis, error_bound, output, positive, scratch_size, vector};
use super::{Input, Look, Producing, Rehearsal, Surfacing, Tiled, Writing};

/// `subap focus`.
#[derive(Debug, Group)]
#[command(
    mut_arg("paths", |paths| paths.required(false).required_unless_present("from_maps")),
    mut_arg("from_maps", |maps| maps.conflicts_with_all(formers::ids_but_the_bound())),
    mut_arg("plan", |plan| plan.conflicts_with_all(formers::ids())),
)]
pub(crate) struct Focus {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Form the image from a module's maps, and from no recording
    #[arg(long, value_name = "MAPS", value_hint = ValueHint::FilePath, conflicts_with_all = [
        "paths", "channel", "channels", "set", "velocity", "surface", "geoid", "troposphere", "track", "phase", "window", "slow_window", "beam", "squint", "scratch", "check", "portable",
        "model"
    ])]
    pub(crate) from_maps: Option<PathBuf>,

    /// Folder for image.npy, image.json and image.png
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) image: Imaging,

    /// Focus what moves at this velocity, m/s; pixels are places at the first pulse
    #[arg(long, value_name = "VX,VY[,VZ]", allow_hyphen_values = true, value_parser = vector(Dimension::Speed))]
    pub(crate) velocity: Option<DVec3>,

    /// The radar moved as this track says, in place of the recorded positions, as subap track writes it: places and attitudes of the
    /// body whose origin is the middle of the antennas and whose x axis lies along the receivers; or mpga, the track of the recording's
    /// own echoes, with what subap track takes by default; or fused, that of the echoes and of navigation: the recording's own positions, or
    /// the logs of --navigation
    #[arg(long, value_name = "CSV|mpga|fused", value_hint = ValueHint::FilePath, value_parser = track_source(),
        conflicts_with_all = ["tiled", "plan", "tiles", "resume"])]
    pub(crate) track: Option<TrackSource>,

    #[command(flatten)]
    pub(crate) logs: Logs,

    /// Take these phase errors away first, a pulse each, as subap autofocus writes them
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath,
        conflicts_with_all = ["tiled", "plan", "tiles", "resume"])]
    pub(crate) phase: Option<PathBuf>,

    /// Form N pixels, chosen by a fixed seed, by the exact sum too and report the image's error
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) check: Option<usize>,

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

/// What `--beam` says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BeamWidth {
    /// Full width, radians.
    Given(f64),
    /// From the Doppler spectrum.
    Estimated,
    /// All pulses form all pixels.
    None,
}

impl std::fmt::Display for BeamWidth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(width_rad) => write!(f, "{} deg", width_rad.to_degrees()),
            Self::Estimated => f.write_str("auto"),
            Self::None => f.write_str("none"),
        }
    }
}

fn beam(text: &str) -> Result<BeamWidth, String> {
    match text {
        "auto" => Ok(BeamWidth::Estimated),
        "none" => Ok(BeamWidth::None),
        angle => {
            let degrees = above_zero(Dimension::Angle)(angle)
                .map_err(|error| format!("{error}; or auto, or none"))?;
            Ok(BeamWidth::Given(degrees.to_radians()))
        }
    }
}

/// What an image's pixels depend on, beside the recording: what a plan of it is made of.
#[derive(Debug, Group)]
pub(crate) struct Imaging {
    #[command(flatten)]
    pub(crate) former: FormerOptions,

    /// Write the image even if its predicted error is above the bound; the record says so, and the exit
    /// status is 3. Implied where an algorithm is named or no --error-db is given
    #[arg(long)]
    pub(crate) allow_error: bool,

    /// Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Window over slow time, across all pulses: as --window
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) slow_window: Window,

    /// Width of the antenna's beam along the track: each place is formed of the pulses that see it under this angle, so that a strip has no
    /// ghosts from pulses whose beam is elsewhere (azimuth ambiguities). auto estimates it from the azimuth Doppler spectrum, none takes all
    /// pulses for all pixels [default: the beam stated by the recording; else auto where places are seen under more angles than the spacing of pulses
    /// samples and the spectrum clearly shows a beam]
    #[arg(long, value_name = "DEG|auto|none", value_parser = beam)]
    pub(crate) beam: Option<BeamWidth>,

    /// How far forward of broadside the middle of the beam looks; backward is negative. Of an estimated beam, about how far [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = any(Dimension::Angle), requires = "beam")]
    pub(crate) squint: Option<f64>,

    /// Pixels, metres in the scene frame, stop excluded: x=-50:50:0.2,y=-50:50:0.2,z=0 (one step is
    /// enough for both) or polar r=..,theta=.. (degrees); also cx, cy, yaw, pitch, roll [default: the
    /// scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    #[command(flatten)]
    pub(crate) surfacing: Surfacing,

    /// Form the same bits on every machine: Fourier transforms take two to four times as long
    #[arg(long)]
    pub(crate) portable: bool,

    /// Choose by the times of another machine, as subap plan calibrate has measured them [default: those that are built in, so
    /// that every machine makes the same plan]
    #[arg(long, value_name = "MODEL", value_hint = ValueHint::FilePath, help_heading = "Tiles")]
    pub(crate) model: Option<PathBuf>,

    /// Memory for tables and one thread's buffers, on which a plan depends: that of the smallest machine that is to
    /// carry it out [default: 48M]
    #[arg(long, value_name = "SIZE", value_parser = scratch_size, help_heading = "Tiles")]
    pub(crate) scratch: Option<u64>,
}

impl Imaging {
    /// Whether the image may be worse than asked: a former that the user names forms it anyway, and so does any where the bound is the
    /// default.
    pub(crate) fn bound_policy(&self) -> BoundPolicy {
        let former = &self.former;
        match self.allow_error || former.is_named() || !former.has_bound() {
            true => BoundPolicy::Allowed,
            false => BoundPolicy::Refused,
        }
    }

    /// By what means it is formed, with the time model that was read, if there is one.
    pub(crate) fn numerics<'m>(&self, model: Option<&'m TimeModel>) -> Numerics<'m> {
        let numerics = numerics(self.portable);
        let model = model.unwrap_or(numerics.model);
        Numerics { model, ..numerics }
    }
}

/// What `--portable` asks for.
fn numerics<'m>(portable: bool) -> Numerics<'m> {
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

    /// Where the target is at the first pulse, metres in the scene frame
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) at: DVec3,

    /// Velocities along x, m/s, stop excluded [default: both ways from 0 in steps of half the resolution, as far as they are unambiguous,
    /// 128 steps at the most]
    #[arg(long, value_name = "START:STOP:STEP", allow_hyphen_values = true, value_parser = axis(Dimension::Speed))]
    pub(crate) vx: Option<Axis>,

    /// Velocities along y, m/s, stop excluded [default: likewise]
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

    /// Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Window over slow time, across all pulses: as --window
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) slow_window: Window,

    /// Form the same bits on every machine: Fourier transforms take two to four times as long
    #[arg(long)]
    pub(crate) portable: bool,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

impl Velocity {
    /// By what means it is formed.
    pub(crate) fn numerics(&self) -> Numerics<'static> {
        numerics(self.portable)
    }
}
