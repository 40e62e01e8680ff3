//! `subap view`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

/// `subap view`.
#[derive(Debug, Group)]
#[command(
    after_help = "The address of the page is printed; Ctrl-C ends the command. The address ends with a random secret, new in each run, without which\n\
    no request is answered, not even from other users of this machine. On the page, ? lists all keys. The part of the address after # is\n\
    the view; append it to the address of a later run to restore it.\n\n\
    Example:\n  \
    subap view before after --layer detections.geojson --open"
)]
pub(crate) struct View {
    /// Images: folders of products, complete or still being formed in tiles, complex64 arrays (.npy) or SICD
    #[arg(required = true, value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) images: Vec<PathBuf>,

    /// Shapes to draw over the images: GeoJSON (longitude and latitude; metres in the scene frame if the image has no position on the Earth), or a track
    /// (.csv). May be repeated
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) layer: Vec<PathBuf>,

    /// Range-Doppler maps to show for a selected position: of the nearest patch from a file of a module's maps, or computed about that position from a
    /// recording (CPHD, GOTCHA .mat, description). May be repeated
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) maps: Vec<PathBuf>,

    /// Number of pulses per sub-CPI of maps computed from a recording
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = super::values::positive)]
    pub(crate) sub_cpi: usize,

    /// Open the page in the default browser. The address is an argument of the browser's process, which other users of this machine may be able to list
    #[arg(long)]
    pub(crate) open: bool,

    /// Port of 127.0.0.1 to serve the page at [default: a free one]
    #[arg(long, value_name = "PORT", conflicts_with = "listen")]
    pub(crate) port: Option<u16>,

    /// Address to serve the page at. At addresses other than 127.0.0.1 and ::1, everyone who can connect and has the printed address with its secret
    /// can view the images; traffic is not encrypted
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) listen: Option<SocketAddr>,
}
