//! Recordings opened, with nothing to be said about how.

use std::path::Path;

use subaperture_focus::machine;
use subaperture_io::open::{self as files, Options};
use subaperture_model::phase_history::{Joined, ReadError};

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

/// Opens recordings and joins them into one aperture, its pulses in the order of time, or of angle where no time is
/// recorded, whatever the order of `paths`.
///
/// # Errors
/// As [`open()`], and [`ReadError::Mismatch`] if there are none or they do not fit together.
pub fn open_all<P: AsRef<Path>>(paths: &[P]) -> Result<Joined, ReadError> {
    let options = Options {
        memory_bytes: machine::default_bytes(),
        ..Options::default()
    };
    files::open_all(paths, &options)
}
