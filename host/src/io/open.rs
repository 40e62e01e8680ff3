//! Recordings opened by what they hold, not by how they are called.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{cphd, gotcha, matlab};
use crate::phase_history::{Aperture, PhaseHistory, ReadError};

const SUPPORTED: &str = "CPHD 1.x and GOTCHA (MATLAB 5) files are read";

/// Opens a recording. `channel` names one of a CPHD's channels; its reference channel if `None`.
///
/// # Errors
/// [`ReadError::Malformed`] for a file of no known format, saying what it looks like, and for a
/// broken one; [`ReadError::Mismatch`] for a channel of a format that has none; [`ReadError::Io`].
pub fn open(path: &Path, channel: Option<&str>) -> Result<Box<dyn PhaseHistory>, ReadError> {
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    if start.starts_with(matlab::MAGIC) {
        if let Some(channel) = channel {
            return Err(ReadError::Mismatch(format!(
                "{}: a GOTCHA file has no channels; leave out channel '{channel}'",
                path.display()
            )));
        }
        return Ok(Box::new(gotcha::read(path)?));
    }
    if start.starts_with(b"CPHD/1.") {
        return Ok(Box::new(cphd::Cphd::open(path, channel)?));
    }
    Err(ReadError::Malformed {
        path: path.to_owned(),
        what: format!("{}; {SUPPORTED}", describe(&start)),
    })
}

/// Opens recordings and joins them, in the order given, into one aperture.
///
/// # Errors
/// As [`open`], and [`ReadError::Mismatch`] if there are none or they do not fit together.
pub fn open_all<P: AsRef<Path>>(paths: &[P], channel: Option<&str>) -> Result<Aperture, ReadError> {
    let parts = paths
        .iter()
        .map(|path| open(path.as_ref(), channel))
        .collect::<Result<_, _>>()?;
    Aperture::join(parts)
}

/// The first bytes: enough to know every format by.
fn read_start(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path)?.take(64).read_to_end(&mut start)?;
    Ok(start)
}

/// What a file of no supported format looks like, and what to do with it.
fn describe(start: &[u8]) -> &'static str {
    let known: [(&[u8], &str); 9] = [
        (
            b"MATLAB 7.3 MAT-file",
            "a MATLAB 7.3 (HDF5) file: load it in MATLAB and save it again with -v7",
        ),
        (
            b"CPHD/0.",
            "CPHD of a version before 1: convert it to CPHD 1.1",
        ),
        (b"CPHD", "CPHD of an unknown version"),
        (b"CRSD", "a CRSD file: convert it to CPHD 1.1"),
        (
            b"NITF",
            "a NITF file (SICD or SIDD): an image already, not phase history",
        ),
        (b"\x89HDF", "an HDF5 file: convert it to CPHD 1.1"),
        (b"\x93NUMPY", "a NumPy array, without the pulses' geometry"),
        (b"PK\x03\x04", "a zip archive (npz?): unpack or convert it"),
        (b"\x1f\x8b", "a gzip file: unpack it"),
    ];
    if start.is_empty() {
        return "the file is empty";
    }
    known
        .iter()
        .find(|(magic, _)| start.starts_with(magic))
        .map_or("neither CPHD nor MATLAB 5 by its first bytes", |k| k.1)
}
