//! Opening recordings with default options.

use std::path::Path;

use crate::convention::INFERENCE;
use subaperture_focus::machine;
use subaperture_io::open::{self as files, Options};
use subaperture_model::phase_history::{Channels, Joined, ReadError};

/// Open a recording. The format is recognised by content: CPHD, CRSD, NISAR L0B, GOTCHA, arrays; or by name: a raw recording's description (`.toml`), samples of the
/// Gotcha GMTI challenge (`PREFIX_chanN_SET_PH`).
///
/// If the file does not state the sign or reference of its phase, they are inferred or the file is refused ([`convention`](crate::convention)).
///
/// The recording may use half of the machine's memory. Of a CPHD file the reference channel is opened.
/// [`io::open`](crate::io::open) has further options.
///
/// # Errors
/// [`ReadError`], also for a format whose feature is off.
pub fn open(path: impl AsRef<Path>) -> Result<Joined, ReadError> {
    open_all(&[path])
}

/// Open all channels of a recording. A channel is one receiver, transmitter or polarisation; all channels share their pulses.
/// Formers take one channel or the coherent sum:
///
/// ```no_run
/// use subaperture::prelude::*;
///
/// let channels = open_channels("mimo.cphd")?;
/// for (about, history) in channels.iter() {
///     println!("{}: {} pulses", about.name, history.collection().pulses.len());
/// }
/// let grid = "x=-50:50:0.2,y=-50:50:0.2,z=0".parse()?;
/// let first = RangeDopplerBackprojection::default().focus(channels.channel(0), &grid)?;
/// let all = RangeDopplerBackprojection::default().focus(&channels.coherent_sum()?, &grid)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`open()`], and [`ReadError::Channels`] if the channels do not share their pulses.
pub fn open_channels(path: impl AsRef<Path>) -> Result<Channels<'static>, ReadError> {
    files::open_channels::<&str>(path.as_ref(), None, &options())
}

/// Open recordings and join them into one aperture. Pulses are sorted by time, or by angle if no time is recorded; the order of
/// `paths` does not matter.
///
/// # Errors
/// As [`open()`], and [`ReadError::Mismatch`] if `paths` is empty or the recordings do not fit together.
pub fn open_all<P: AsRef<Path>>(paths: &[P]) -> Result<Joined, ReadError> {
    files::open_all(paths, &options())
}

fn options() -> Options<'static> {
    Options {
        memory_bytes: machine::default_bytes(),
        inference: Some(INFERENCE),
        ..Options::default()
    }
}
