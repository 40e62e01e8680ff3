//! `subap live`, and the web page of a running capture.

#[cfg(feature = "page")]
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use subaperture::signal::window::Window;

use super::Writing;
use super::values::{error_bound, output, setting};

/// Web page of a running capture.
#[derive(Clone, Debug, Group)]
pub(crate) struct Watching {
    /// Serve the display as a web page to browsers of this machine, and print its address
    #[cfg(feature = "page")]
    #[arg(long)]
    pub(crate) page: bool,

    /// Address to serve the page at. At addresses other than 127.0.0.1 and ::1, everyone who can connect and has the printed address with its
    /// secret can view it; traffic is not encrypted
    #[cfg(feature = "page")]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) listen: Option<SocketAddr>,
}

impl Watching {
    /// Whether a page is requested.
    pub(crate) fn is_asked(&self) -> bool {
        #[cfg(feature = "page")]
        return self.page || self.listen.is_some();
        #[cfg(not(feature = "page"))]
        return false;
    }
}

/// `subap live`.
#[derive(Debug, Group)]
#[command(
    after_help = "The section [live] of the experiment states the pixels and the motion of the antennas: a track file, a rail at constant\n\
    speed, or an estimate from the echoes of two receivers (MPGA). See subap capture --keys, and subap capture\n\
    --example rail with rail-scene, or walk with walk-scene.\n\n\
    Ctrl-C ends the capture; recording and image up to then are complete (exit status 130, or 0 if plan.sweeps = 0)."
)]
pub(crate) struct Live {
    /// Experiment in TOML, as for subap capture
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath)]
    pub(crate) experiment: PathBuf,

    /// Name of the recording, to which .sigmf-data and .sigmf-meta are added; existing files are not replaced [default: files.recording
    /// of the experiment]
    #[arg(long, short, value_name = "NAME", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// Folder for the final image: image.npy, image.json and image.png, as from subap focus
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) image: Option<PathBuf>,

    /// Override a key of the experiment, such as plan.sweeps=100. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Window over carriers: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Bound on the relative RMS error of the image, dB; sweeps that would exceed it are left out
    #[arg(long, value_name = "DB", default_value_t = -40.0, allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: f64,

    #[command(flatten)]
    pub(crate) watching: Watching,

    #[command(flatten)]
    pub(crate) writing: Writing,
}
