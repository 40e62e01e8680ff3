//! NITF container shared by the SICD and SIDD readers: headers, XML and image rows.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use num_complex::Complex32;

use subaperture_io::xml::check;
use subaperture_model::image::{Image, PixelBlock};

use crate::header::{FileHeader, Segment};

/// Largest XML that is read, bytes.
pub const MAX_XML_BYTES: u64 = 16 << 20;

/// Bytes of a file header up to its list of image segments.
const START_BYTES: u64 = 363;
/// Bytes of an extension in which the standard's name is searched.
const SEARCHED_BYTES: u64 = 1000;

/// Error of reading a SICD or SIDD file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Input or output error.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The file is damaged or not of a supported format.
    #[error("{}: {what}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// Fault and its position.
        what: String,
    },
}

/// An open NITF file.
#[derive(Debug)]
pub(crate) struct Container {
    path: PathBuf,
    file: File,
    /// Size of the file, bytes.
    pub(crate) length: u64,
    pub(crate) header: FileHeader,
}

impl Container {
    /// Read the file header. `path` is for messages.
    pub(crate) fn open(file: File, path: &Path) -> Result<Self, ReadError> {
        let mut container = Self {
            path: path.to_owned(),
            file,
            length: 0,
            header: FileHeader::default(),
        };
        let metadata = container.file.metadata();
        container.length = metadata.map_err(|source| container.io(source))?.len();
        let start = container.bytes(0, START_BYTES, "the file header")?;
        let header_bytes = FileHeader::bytes(&start).map_err(|what| container.fault(what))?;
        let header = container.bytes(0, header_bytes, "the file header")?;
        container.header = FileHeader::parse(&header).map_err(|what| container.fault(what))?;
        Ok(container)
    }

    fn io(&self, source: io::Error) -> ReadError {
        ReadError::Io {
            path: self.path.clone(),
            source,
        }
    }

    /// Format error of this file.
    pub(crate) fn fault(&self, what: String) -> ReadError {
        ReadError::Format {
            path: self.path.clone(),
            what,
        }
    }

    /// Read `count` bytes at `at`; `what` names them in the error.
    pub(crate) fn bytes(&mut self, at: u64, count: u64, what: &str) -> Result<Vec<u8>, ReadError> {
        if at.checked_add(count).is_none_or(|end| end > self.length) {
            return Err(self.fault(format!(
                "expected {what} of {count} bytes at byte {at}, found a file of {} bytes; it is truncated or damaged",
                self.length
            )));
        }
        let mut bytes = vec![0; count as usize];
        let read = self.file.seek(SeekFrom::Start(at));
        let read = read.and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|source| self.io(source))?;
        Ok(bytes)
    }

    /// Header of an image segment.
    pub(crate) fn image_header(&mut self, segment: &Segment) -> Result<Vec<u8>, ReadError> {
        self.bytes(segment.header, segment.header_bytes, "an image header")
    }

    /// Format error of an image segment's header.
    pub(crate) fn image_fault(&self, segment: &Segment, what: &str) -> ReadError {
        self.fault(format!("image header at byte {}: {what}", segment.header))
    }

    /// Read the XML of the first extension whose beginning contains `standard`; `None` if there is no such extension. It takes at most
    /// `memory_bytes` once parsed.
    pub(crate) fn xml(
        &mut self,
        standard: &str,
        memory_bytes: u64,
    ) -> Result<Option<String>, ReadError> {
        for segment in self.header.extensions.clone() {
            let searched = segment.data_bytes.min(SEARCHED_BYTES);
            let begins = self.bytes(segment.data, searched, "an extension")?;
            if !String::from_utf8_lossy(&begins).contains(standard) {
                continue;
            }
            let most_bytes = MAX_XML_BYTES.min(memory_bytes / 2);
            if segment.data_bytes > most_bytes {
                return Err(self.fault(format!(
                    "expected XML of at most {most_bytes} bytes, found {}: the file is damaged, or more memory is needed",
                    segment.data_bytes
                )));
            }
            let bytes = self.bytes(segment.data, segment.data_bytes, "the XML")?;
            let text = String::from_utf8(bytes);
            return match text {
                Ok(text) => match check(&text, memory_bytes) {
                    Ok(()) => Ok(Some(text)),
                    Err(fault) => Err(self.fault(format!("XML: {fault}"))),
                },
                Err(_) => Err(self.fault("the XML is not UTF-8".to_owned())),
            };
        }
        Ok(None)
    }

    /// Reader of the pixels of an image in segments.
    pub(crate) fn into_pixels(
        self,
        size: (usize, usize),
        pixel_bytes: usize,
        segments: Vec<Blocks>,
    ) -> Pixels {
        Pixels {
            path: self.path,
            file: Mutex::new(self.file),
            size,
            pixel_bytes,
            segments,
        }
    }
}

/// Image segment in uncompressed blocks, row by row of blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocks {
    /// First row of the segment in the image.
    pub(crate) first_row: usize,
    /// Columns of a block.
    pub(crate) wide: usize,
    /// Rows of a block.
    pub(crate) high: usize,
    /// Blocks per row of blocks.
    pub(crate) across: usize,
    /// File offset of the first block, bytes.
    pub(crate) data: u64,
}

/// Pixels of an image, read by windows.
#[derive(Debug)]
pub(crate) struct Pixels {
    path: PathBuf,
    // One window is read at a time.
    file: Mutex<File>,
    /// Rows and columns.
    size: (usize, usize),
    pixel_bytes: usize,
    segments: Vec<Blocks>,
}

impl Pixels {
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Read a window; `decode` converts the bytes of one pixel.
    pub(crate) fn read(
        &self,
        [rows, columns]: &PixelBlock,
        decode: impl Fn(&[u8]) -> Complex32,
    ) -> Result<Image, ReadError> {
        let io = |source| ReadError::Io {
            path: self.path.clone(),
            source,
        };
        let mut pixels = Vec::with_capacity(rows.len() * columns.len());
        let mut line = Vec::new();
        let mut file = self
            .file
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        for row in rows.clone() {
            let n = self.segments.partition_point(|s| s.first_row <= row) - 1;
            let Blocks {
                first_row,
                wide,
                high,
                across,
                data,
            } = self.segments[n];
            let (block_row, own_row) = ((row - first_row) / high, (row - first_row) % high);
            for block in columns.start / wide..columns.end.div_ceil(wide) {
                let from = columns.start.max(block * wide);
                let to = columns.end.min((block + 1) * wide);
                let index = (block_row * across + block) as u64;
                let pixel =
                    index * (wide * high) as u64 + (own_row * wide + from - block * wide) as u64;
                line.resize((to - from) * self.pixel_bytes, 0);
                file.seek(SeekFrom::Start(data + pixel * self.pixel_bytes as u64))
                    .map_err(io)?;
                file.read_exact(&mut line).map_err(io)?;
                pixels.extend(line.chunks_exact(self.pixel_bytes).map(&decode));
            }
        }
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels,
        })
    }
}
