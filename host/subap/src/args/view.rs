//! `subap view`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

/// `subap view`.
#[derive(Debug, Group)]
#[command(
    after_help = "The page's address is printed; Ctrl-C ends it. The address ends with a random secret, new in each run: without it nothing is\n\
    answered, to other users of this machine neither. On the page, ? shows all keys. What follows # in its address is the view: keep that, and put\n\
    it behind the address of a later run.\n\n\
    Example:\n  \
    subap view before after --layer detections.geojson --port 8080"
)]
pub(crate) struct View {
    /// Images: folders of products, whole or still being formed in tiles, complex64 arrays (.npy) or anyone's SICD
    #[arg(required = true, value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) images: Vec<PathBuf>,

    /// Draw shapes over the images: GeoJSON (longitude and latitude; metres in the scene frame where the image is not on the Earth), or a track (.csv); any
    /// number of times
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) layer: Vec<PathBuf>,

    /// Show range-Doppler maps about a place of the image: those of a file of a module's maps, whose patches they are of, or made of the recording (CPHD, GOTCHA .mat, a
    /// description) about the very place; any number of times
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) maps: Vec<PathBuf>,

    /// Pulses of a sub-CPI of maps that are made of a recording
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = super::values::positive)]
    pub(crate) sub_cpi: usize,

    /// Serve the page at this port of 127.0.0.1 [default: any that is free]
    #[arg(long, value_name = "PORT", conflicts_with = "listen")]
    pub(crate) port: Option<u16>,

    /// Serve the page at this address; on others than 127.0.0.1 and ::1 everybody who reaches it and has the whole address that is printed, with its
    /// secret, can look; nothing is encrypted
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) listen: Option<SocketAddr>,
}
