//! A file read at given places; every read is checked against the length found at opening.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use num_complex::Complex32;

use super::conventions::SignalFormat;
use crate::input::Stamp;
use subaperture_model::phase_history::{InputFile, ReadError};

/// Bytes read from the file at a time; also the size of the buffers for it.
pub(crate) const CHUNK_BYTES: usize = 1 << 20;

/// An open file, its name for errors, and its length when it was opened.
pub(crate) struct Source {
    file: File,
    path: PathBuf,
    len: u64,
    stamp: Stamp,
    /// CRC-32 of the whole file, once somebody asked.
    checksum: OnceLock<u32>,
}

impl Source {
    /// The path, for messages.
    pub(crate) fn name(&self) -> String {
        self.path.display().to_string()
    }

    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
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
            checksum: OnceLock::new(),
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Length in bytes when the file was opened.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Fails if the file has been written to since it was opened.
    pub(crate) fn check_unchanged(&self) -> Result<(), ReadError> {
        self.stamp.check(&self.file, &self.path)
    }

    /// The file with its size and CRC-32. What was read of it in the meantime is what this checksum is of, or it is an error.
    pub(crate) fn input(&self) -> Result<InputFile, ReadError> {
        let checksum = match self.checksum.get() {
            Some(&known) => known,
            None => {
                let mut hasher = crc32fast::Hasher::new();
                let mut bytes = vec![0; CHUNK_BYTES];
                let mut at = 0;
                while at < self.len {
                    let count = (self.len - at).min(CHUNK_BYTES as u64) as usize;
                    self.read_at(at, &mut bytes[..count])?;
                    hasher.update(&bytes[..count]);
                    at += count as u64;
                }
                *self.checksum.get_or_init(|| hasher.finalize())
            }
        };
        self.check_unchanged()?;
        Ok(InputFile {
            path: self.path.clone(),
            bytes: self.len,
            crc32: format!("{checksum:08x}"),
        })
    }

    /// Reads `count` records of `width` bytes from `offset` on, in chunks, and hands each to `take` with its number; `block` names
    /// them in errors.
    pub(crate) fn read_records(
        &self,
        block: &str,
        offset: u64,
        count: usize,
        width: usize,
        mut take: impl FnMut(u64, &[u8]) -> Result<(), String>,
    ) -> Result<(), ReadError> {
        let at_once = (CHUNK_BYTES / width).max(1);
        let mut bytes = vec![0; width * at_once.min(count)];
        let place = |index: usize| offset + index as u64 * width as u64;
        let mut index = 0;
        while index < count {
            let n = at_once.min(count - index);
            self.read_at(place(index), &mut bytes[..n * width])?;
            for record in bytes[..n * width].chunks_exact(width) {
                take(index as u64, record).map_err(|what| {
                    self.malformed(format!("{what} ({block} at byte {})", place(index)))
                })?;
                index += 1;
            }
        }
        Ok(())
    }

    /// Read stored samples, converted only in number format, of an array that begins at `offset`, from flat index `first` on.
    pub(crate) fn read_samples(
        &self,
        format: SignalFormat,
        offset: u64,
        first: usize,
        samples: &mut [Complex32],
    ) -> Result<(), ReadError> {
        let width = format.sample_bytes();
        let chunk = CHUNK_BYTES / width;
        let mut bytes = vec![0; samples.len().min(chunk) * width];
        for (i, part) in samples.chunks_mut(chunk).enumerate() {
            let bytes = &mut bytes[..part.len() * width];
            let at = (first + i * chunk) as u64 * width as u64;
            self.read_at(offset + at, bytes)?;
            format.decode(bytes, part);
        }
        Ok(())
    }

    /// A [`ReadError::Malformed`] about this file.
    pub(crate) fn malformed(&self, what: impl Into<String>) -> ReadError {
        ReadError::Malformed {
            path: self.path.clone(),
            what: what.into(),
        }
    }

    /// Fails with [`ReadError::Memory`] if `needed_bytes` are more than `allowed_bytes`.
    pub(crate) fn check_memory(
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
    pub(crate) fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<(), ReadError> {
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
