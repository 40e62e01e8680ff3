//! Recordings opened, with nothing to be said about how.

use std::path::Path;

use subaperture_focus::machine;
use subaperture_io::open::{self as files, Options};
use subaperture_model::phase_history::{Channels, Joined, ReadError};

/// Opens a recording by what the file holds: CPHD, GOTCHA, or a raw recording's description (`.toml`).
///
/// It may hold half of the machine's memory; of a CPHD file the reference channel is taken.
/// [`io::open`](crate::io::open) has more to choose.
///
/// # Errors
/// [`ReadError`], also for a format whose feature is off.
pub fn open(path: impl AsRef<Path>) -> Result<Joined, ReadError> {
    open_all(&[path])
}

/// Opens all channels of a recording side by side: a receiver, a transmitter or a polarisation each, with shared pulses.
/// Formers take one of them, or their coherent sum:
///
/// ```no_run
/// use subaperture::prelude::*;
///
/// let channels = open_channels("mimo.cphd")?;
/// for (about, history) in channels.iter() {
///     println!("{}: {} pulses", about.name, history.collection().pulses.len());
/// }
/// let grid = "x=-50:50:0.2,y=-50:50:0.2,z=0".parse()?;
/// let first = RangeDoppler::default().focus(channels.channel(0), &grid)?;
/// let all = RangeDoppler::default().focus(&channels.coherent_sum()?, &grid)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`open()`], and [`ReadError::Channels`] if they do not share their pulses.
pub fn open_channels(path: impl AsRef<Path>) -> Result<Channels<'static>, ReadError> {
    files::open_channels::<&str>(path.as_ref(), None, &options())
}

/// Opens recordings and joins them into one aperture, its pulses in the order of time, or of angle where no time is
/// recorded, whatever the order of `paths`.
///
/// # Errors
/// As [`open()`], and [`ReadError::Mismatch`] if there are none or they do not fit together.
pub fn open_all<P: AsRef<Path>>(paths: &[P]) -> Result<Joined, ReadError> {
    files::open_all(paths, &options())
}

fn options() -> Options<'static> {
    Options {
        memory_bytes: machine::default_bytes(),
        ..Options::default()
    }
}
