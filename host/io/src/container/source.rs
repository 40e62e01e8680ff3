//! Open file on disk, in memory or at a URL, with reads at given positions, checked against its length at opening.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::input::Stamp;
use crate::remote::{self, Remote};
use crate::xml::parsed_bytes;
use subaperture_model::phase_history::{InputFile, ReadError};

/// Size of a read of records, bytes; also of its buffer.
pub(crate) const CHUNK_BYTES: usize = 1 << 20;

/// Range of bytes that lies within the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// First byte, from the beginning of the file.
    pub offset: u64,
    /// Size of the block, bytes.
    pub size: u64,
}

/// An open file with its path for errors.
#[derive(Debug)]
pub struct Source {
    content: Content,
    path: PathBuf,
    len: u64,
    /// CRC-32 of the whole file, computed on first use.
    checksum: OnceLock<u32>,
}

/// Where the bytes of a source are.
#[derive(Debug)]
enum Content {
    File { file: File, stamp: Stamp },
    Memory(Vec<u8>),
    Remote(Box<Remote>),
}

impl Source {
    /// Open a file, or a URL by the opener of [`remote`], for positioned reads.
    ///
    /// # Errors
    /// [`ReadError::Io`] if the system refuses, it is a folder, or the URL cannot be opened.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        if let Some(url) = remote::url(path) {
            let file = Remote::open(url).map_err(io)?;
            return Ok(Self {
                len: file.len(),
                content: Content::Remote(Box::new(file)),
                path: path.to_owned(),
                checksum: OnceLock::new(),
            });
        }
        Self::of(File::open(path).map_err(io)?, path)
    }

    /// An open file; `path` is for errors.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn of(file: File, path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            return Err(io(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        let stamp = Stamp::of(&file).map_err(io)?;
        Ok(Self {
            content: Content::File { file, stamp },
            path: path.to_owned(),
            len: metadata.len(),
            checksum: OnceLock::new(),
        })
    }

    /// The bytes of a file in memory; `name` is for errors.
    pub fn of_bytes(bytes: Vec<u8>, name: &Path) -> Self {
        Self {
            len: bytes.len() as u64,
            content: Content::Memory(bytes),
            path: name.to_owned(),
            checksum: OnceLock::new(),
        }
    }

    /// Memory that holds bytes of the file; 0 for a file on disk.
    #[cfg(feature = "cphd")]
    pub(crate) fn held_bytes(&self) -> u64 {
        match &self.content {
            Content::File { .. } => 0,
            Content::Memory(bytes) => bytes.len() as u64,
            Content::Remote(file) => file.held_bytes(),
        }
    }

    /// Whether the bytes are at a URL.
    #[cfg(feature = "cphd")]
    pub(crate) fn is_remote(&self) -> bool {
        matches!(self.content, Content::Remote(_))
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the file as text.
    #[cfg(feature = "cphd")]
    pub(crate) fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// Length of the file when it was opened, bytes.
    #[expect(clippy::len_without_is_empty, reason = "a file, not a collection")]
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Compare the file with its state at opening.
    ///
    /// # Errors
    /// [`ReadError::Changed`] if it was written to since.
    pub fn check_unchanged(&self) -> Result<(), ReadError> {
        match &self.content {
            Content::File { file, stamp } => stamp.check(file, &self.path),
            Content::Memory(_) => Ok(()),
            Content::Remote(file) => file.check_unchanged(&self.path),
        }
    }

    /// Path, size and CRC-32 of the file, computed once; the version of a file at a URL.
    ///
    /// # Errors
    /// [`ReadError::Changed`] if the file was written to since it was opened; [`ReadError::Io`].
    pub fn input(&self) -> Result<InputFile, ReadError> {
        if let Content::Remote(file) = &self.content {
            return file.input(&self.path);
        }
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
        Ok(InputFile::with_crc32(
            &self.path,
            self.len,
            format!("{checksum:08x}"),
        ))
    }

    /// Read `count` records of `width` bytes from `offset` on, in chunks, and pass each to `take` with its index; `block` names
    /// them in errors.
    #[cfg(feature = "cphd")]
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

    /// [`ReadError::Malformed`] about this file.
    pub fn malformed(&self, what: impl Into<String>) -> ReadError {
        ReadError::Malformed {
            path: self.path.clone(),
            what: what.into(),
        }
    }

    /// Compare memory needed with the limit.
    ///
    /// # Errors
    /// [`ReadError::Memory`] if `needed_bytes` exceeds `allowed_bytes`.
    pub fn check_memory(&self, needed_bytes: u64, allowed_bytes: u64) -> Result<(), ReadError> {
        if needed_bytes <= allowed_bytes {
            return Ok(());
        }
        Err(ReadError::Memory {
            path: self.path.clone(),
            needed_bytes,
            allowed_bytes,
        })
    }

    /// Check that a range lies within the file; `what` names it in the error.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if it does not.
    pub fn check_range(&self, offset: u64, size: u64, what: &str) -> Result<(), ReadError> {
        match offset.checked_add(size) {
            Some(end) if end <= self.len => Ok(()),
            _ => Err(self.malformed(format!(
                "expected {what} of {size} bytes at byte {offset}, found a file of {} bytes; it is truncated or damaged",
                self.len
            ))),
        }
    }

    /// Read the bytes of a range; `what` names them in the error. The range is compared with the file's length before memory is allocated.
    ///
    /// # Errors
    /// As [`Self::check_range`]; [`ReadError::Io`].
    pub fn bytes(&self, offset: u64, size: u64, what: &str) -> Result<Vec<u8>, ReadError> {
        self.check_range(offset, size, what)?;
        let mut bytes = vec![0; size as usize];
        self.read_at(offset, &mut bytes)?;
        Ok(bytes)
    }

    /// Read XML that takes at most `memory_bytes` once parsed. The caller has limited the size of the block.
    ///
    /// # Errors
    /// As [`Self::bytes`]; [`ReadError::Malformed`] if it is not UTF-8; [`ReadError::Memory`].
    pub fn xml(&self, block: Block, memory_bytes: u64) -> Result<String, ReadError> {
        self.check_memory(block.size, memory_bytes)?;
        let bytes = self.bytes(block.offset, block.size, "the XML")?;
        let text = String::from_utf8(bytes).map_err(|e| {
            self.malformed(format!(
                "byte {}: the XML block is not UTF-8 text; copy the file again",
                block.offset + e.utf8_error().valid_up_to() as u64
            ))
        })?;
        self.check_memory(parsed_bytes(&text), memory_bytes)?;
        Ok(text)
    }

    /// Fill `bytes` from `offset` on. The caller has checked the range against [`Self::len`], so an
    /// early end means that the file has been shortened since.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file was shortened; [`ReadError::Io`].
    pub fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<(), ReadError> {
        let read = match &self.content {
            Content::File { file, .. } => read_exact_at(file, offset, bytes),
            Content::Memory(held) => copy_at(held, offset, bytes),
            Content::Remote(file) => file.read_at(offset, bytes),
        };
        read.map_err(|source| {
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

/// Copy a range of `held`.
fn copy_at(held: &[u8], offset: u64, bytes: &mut [u8]) -> io::Result<()> {
    let from = usize::try_from(offset)
        .ok()
        .and_then(|first| held.get(first..)?.get(..bytes.len()))
        .ok_or(io::ErrorKind::UnexpectedEof)?;
    bytes.copy_from_slice(from);
    Ok(())
}

/// A browser opens no files.
#[cfg(not(any(unix, windows)))]
fn read_exact_at(_: &File, _: u64, _: &mut [u8]) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
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
