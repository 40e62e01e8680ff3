//! `subap live`, and how a capture is watched while it runs.

#[cfg(feature = "page")]
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use subaperture::signal::window::Window;

use super::Writing;
use super::values::{error_bound, output, setting};

/// Who may look at a capture, beside this terminal.
#[derive(Clone, Debug, Group)]
pub(crate) struct Watching {
    /// Serve the same as a web page with moving pictures, to browsers of this machine; its address is told
    #[cfg(feature = "page")]
    #[arg(long)]
    pub(crate) page: bool,

    /// Serve the page at this address; on others than 127.0.0.1 and ::1 everybody who reaches it and has the whole address that is printed,
    /// with its secret, can look; nothing is encrypted
    #[cfg(feature = "page")]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) listen: Option<SocketAddr>,
}

impl Watching {
    /// Whether there is to be a page.
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
    after_help = "The experiment's section [live] says which pixels, and how the antennas move: a track file, a rail at constant\n\
    speed, or as the echoes of two receivers tell where nobody knows (MPGA). See subap capture --keys, and subap capture\n\
    --example rail with rail-scene, or walk with walk-scene.\n\n\
    Ctrl-C ends it; what was recorded and imaged by then is whole (exit status 130, or 0 where plan.sweeps = 0)."
)]
pub(crate) struct Live {
    /// The experiment, in TOML, as for subap capture
    #[arg(value_name = "EXPERIMENT", value_hint = ValueHint::FilePath)]
    pub(crate) experiment: PathBuf,

    /// Name of the recording; .sigmf-data and .sigmf-meta are added, and nothing is written over [default:
    /// files.recording of the experiment]
    #[arg(long, short, value_name = "NAME", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    /// Folder for the image at the end: image.npy, image.json and image.png, as subap focus leaves them
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) image: Option<PathBuf>,

    /// Override a key of the experiment, as plan.sweeps=100; any number of times
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Window over carriers: none, taylor, taylor:DB, hamming or kaiser:BETA
    #[arg(long, value_name = "W", default_value_t = Window::default())]
    pub(crate) window: Window,

    /// Most that the image may err, relative RMS in dB; a sweep that would make it worse is left out
    #[arg(long, value_name = "DB", default_value_t = -40.0, allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: f64,

    #[command(flatten)]
    pub(crate) watching: Watching,

    #[command(flatten)]
    pub(crate) writing: Writing,
}
