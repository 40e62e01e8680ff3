//! `subap focus` and `subap velocity`.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use glam::DVec3;
use subaperture::focus::{Means, Misses, TimeModel};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::signal::window::Window;
use subaperture::units::Dimension;

use super::formers::{self, FormerOptions};
use super::logs::Logs;
use super::track::{TrackSource, track_source};
use super::values::{any, axis, error_bound, output, positive, scratch_size, vector};
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
        "paths", "channel", "channels", "set", "velocity", "surface", "geoid", "troposphere", "track", "phase", "window", "slow_window", "scratch", "check", "portable",
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

/// What an image's pixels depend on, beside the recording: what a plan of it is made of.
#[derive(Debug, Group)]
pub(crate) struct Imaging {
    #[command(flatten)]
    pub(crate) former: FormerOptions,

    /// Write the image even if its predicted error is above the bound; the record says so, and the exit
    /// status is 3
    #[arg(long)]
    pub(crate) allow_error: bool,

    /// Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Window over slow time, across all pulses: as --window
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) slow_window: Window,

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
    /// Whether the image may be worse than asked.
    pub(crate) fn misses(&self) -> Misses {
        match self.allow_error {
            true => Misses::Allowed,
            false => Misses::Refused,
        }
    }

    /// By what means it is formed, with the time model that was read, if there is one.
    pub(crate) fn means<'m>(&self, model: Option<&'m TimeModel>) -> Means<'m> {
        let means = means(self.portable);
        let model = model.unwrap_or(means.model);
        Means { model, ..means }
    }
}

/// What `--portable` asks for.
fn means<'m>(portable: bool) -> Means<'m> {
    match portable {
        true => Means::default().portable(),
        false => Means::default(),
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

    /// Velocities along x, m/s, stop excluded
    #[arg(long, value_name = "START:STOP:STEP", allow_hyphen_values = true, value_parser = axis(Dimension::Speed))]
    pub(crate) vx: Axis,

    /// Velocities along y, m/s, stop excluded
    #[arg(long, value_name = "START:STOP:STEP", allow_hyphen_values = true, value_parser = axis(Dimension::Speed))]
    pub(crate) vy: Axis,

    /// Velocity along z, m/s
    #[arg(long, value_name = "M/S", default_value_t = 0.0, allow_negative_numbers = true, value_parser = any(Dimension::Speed))]
    pub(crate) vz: f64,

    /// Folder for image.npy, image.json and image.png
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Bound on the relative RMS error against the exact sum, in dB, -20 to -120 [default: -60]
    #[arg(long, value_name = "DB", allow_negative_numbers = true, value_parser = error_bound)]
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
    pub(crate) fn means(&self) -> Means<'static> {
        means(self.portable)
    }
}
