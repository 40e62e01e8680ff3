//! A file read at given places; every read is checked against the length found at opening.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::input::Stamp;
use subaperture_model::phase_history::ReadError;

/// Bytes read from the file at a time; also the size of the buffers for it.
pub(super) const CHUNK_BYTES: usize = 1 << 20;

/// An open file, its name for errors, and its length when it was opened.
pub(super) struct Source {
    file: File,
    path: PathBuf,
    len: u64,
    stamp: Stamp,
}

impl Source {
    /// The path, for messages.
    pub(super) fn name(&self) -> String {
        self.path.display().to_string()
    }

    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            return Err(io(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        Ok(Self {
            stamp: Stamp::of(&file).map_err(io)?,
            file,
            path: path.to_owned(),
            len: metadata.len(),
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Length in bytes when the file was opened.
    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Fails if the file has been written to since it was opened.
    pub(super) fn check_unchanged(&self) -> Result<(), ReadError> {
        self.stamp.check(&self.file, &self.path)
    }

    /// A [`ReadError::Malformed`] about this file.
    pub(super) fn malformed(&self, what: impl Into<String>) -> ReadError {
        ReadError::Malformed {
            path: self.path.clone(),
            what: what.into(),
        }
    }

    /// Fails with [`ReadError::Memory`] if `needed_bytes` are more than `allowed_bytes`.
    pub(super) fn check_memory(
        &self,
        needed_bytes: u64,
        allowed_bytes: u64,
    ) -> Result<(), ReadError> {
        if needed_bytes <= allowed_bytes {
            return Ok(());
        }
        Err(ReadError::Memory {
            path: self.path.clone(),
            needed_bytes,
            allowed_bytes,
        })
    }

    /// Fills `bytes` from `offset` on. The caller has checked the range against [`Self::len`], so an
    /// early end means that the file has been shortened since.
    pub(super) fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<(), ReadError> {
        read_exact_at(&self.file, offset, bytes).map_err(|source| {
            if source.kind() == io::ErrorKind::UnexpectedEof {
                self.malformed(format!(
                    "bytes {offset} to {} are gone: the file had {} bytes when it was opened and \
                     has been shortened since; copy it again",
                    offset + bytes.len() as u64,
                    self.len
                ))
            } else {
                ReadError::Io {
                    path: self.path.clone(),
                    source,
                }
            }
        })
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut offset: u64, mut bytes: &mut [u8]) -> io::Result<()> {
    use std::os::windows::fs::FileExt;
    while !bytes.is_empty() {
        match file.seek_read(bytes, offset) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => {
                bytes = &mut bytes[n..];
                offset += n as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}
