//! Input files: identity of files behind paths, and changes during reading.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use std::time::SystemTime;

use subaperture_model::phase_history::ReadError;

/// First bytes of a MATLAB 5 file.
pub const MATLAB_MAGIC: &[u8] = b"MATLAB 5.0 MAT-file";

/// Whether two paths have led to the same file. True if the system cannot compare them.
pub fn same_file(a: &Metadata, b: &Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        (a.dev(), a.ino()) == (b.dev(), b.ino())
    }
    #[cfg(not(unix))]
    {
        let _ = (a, b);
        true
    }
}

/// Whether two paths lead to the same file through hard links, symbolic links or letter case.
pub fn same_path(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    if let (Ok(a), Ok(b)) = (fs::metadata(a), fs::metadata(b)) {
        return same_file(&a, &b);
    }
    match (fs::canonicalize(a), fs::canonicalize(b)) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// Open a file for reading at any position. Refuses folders, pipes, sockets and devices.
///
/// # Errors
/// [`io::Error`] of the system; [`io::ErrorKind::InvalidInput`] if it is not a file.
pub fn open_file(path: &Path) -> io::Result<File> {
    // Checked before opening, since opening a pipe waits for its writer.
    let about = fs::metadata(path)?;
    if about.is_dir() {
        return Err(io::Error::new(
            io::ErrorKind::IsADirectory,
            "expected a file, found a folder",
        ));
    }
    if !about.is_file() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "expected a file, found a pipe, socket or device: copy it to a file first",
        ));
    }
    File::open(path)
}

/// Remaining length of a file in bytes, and its CRC-32 in hexadecimal.
pub fn checksum(file: &mut File) -> io::Result<(u64, String)> {
    let (mut crc, mut bytes, mut block) = (crc32fast::Hasher::new(), 0, vec![0; 1 << 16]);
    loop {
        match file.read(&mut block)? {
            0 => return Ok((bytes, format!("{:08x}", crc.finalize()))),
            count => {
                crc.update(&block[..count]);
                bytes += count as u64;
            }
        }
    }
}

/// Size and modification time of an open file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Stamp {
    /// Current state of `file`.
    pub fn of(file: &File) -> io::Result<Self> {
        let about = file.metadata()?;
        Ok(Self {
            bytes: about.len(),
            // Not available on every system.
            modified: about.modified().ok(),
        })
    }

    /// Difference of `file` from the recorded state. A file renamed into its place does not count: the open file is
    /// still read to its end.
    pub fn difference(&self, file: &File) -> io::Result<Option<String>> {
        let now = Self::of(file)?;
        Ok(match (now == *self, now.bytes == self.bytes) {
            (true, _) => None,
            (_, true) => Some("it was written to".to_owned()),
            _ => Some(format!("it had {} bytes and has {}", self.bytes, now.bytes)),
        })
    }

    /// Return an error if `file` has been written to since the state was recorded at opening.
    pub fn check(&self, file: &File, path: &Path) -> Result<(), ReadError> {
        match self.difference(file) {
            Ok(None) => Ok(()),
            Ok(Some(how)) => Err(ReadError::Changed {
                path: path.to_owned(),
                how,
            }),
            Err(source) => Err(ReadError::Io {
                path: path.to_owned(),
                source,
            }),
        }
    }
}
