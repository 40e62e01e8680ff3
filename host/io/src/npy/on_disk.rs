//! Image in a `.npy` file, read in parts.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use num_complex::Complex32;

use super::header::{Header, HeaderError};
use super::image_shape;
use crate::input::{Stamp, open_file};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};
use subaperture_model::phase_history::ReadError;

/// Bytes read at a time.
const READ_BYTES: usize = 1 << 16;

/// Open complex64 image file.
#[derive(Debug)]
pub struct ImageFile {
    path: PathBuf,
    file: Mutex<File>,
    stamp: Stamp,
    /// Size of the header in bytes.
    start: u64,
    rows: usize,
    columns: usize,
}

impl ImageFile {
    /// Open a file and read its header.
    ///
    /// # Errors
    /// [`ReadError`] if it is not an image, or shorter than its header states.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = open_file(path).map_err(ReadError::io(path))?;
        Self::of(file, path)
    }

    /// Like [`Self::open`], for a file that is already open, read from its start.
    pub(crate) fn of(file: File, path: &Path) -> Result<Self, ReadError> {
        let io = ReadError::io(path);
        let unsuited = |what: String| ReadError::malformed(path, what);
        let file_bytes = file.metadata().map_err(&io)?.len();
        let stamp = Stamp::of(&file).map_err(&io)?;
        let header = Header::read(&mut BufReader::new(&file)).map_err(|error| match error {
            HeaderError::Io(source) => io(source),
            HeaderError::Unsuited(what) => unsuited(what),
        })?;
        let (rows, columns) = image_shape(&header).map_err(unsuited)?;
        let needed = (u128::from(rows) * u128::from(columns)).saturating_mul(8);
        let present = file_bytes.saturating_sub(header.bytes);
        if needed != u128::from(present) {
            return Err(unsuited(format!(
                "{rows} x {columns} complex64 values: expected {needed} bytes after the header, found {present}"
            )));
        }
        Ok(Self {
            path: path.to_owned(),
            file: Mutex::new(file),
            stamp,
            start: header.bytes,
            rows: rows as usize,
            columns: columns as usize,
        })
    }

    /// Read the whole image. Memory is allocated only for bytes that the file contains.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn read(&self) -> Result<Image, ReadError> {
        self.part(&[0..self.rows, 0..self.columns])
    }

    fn part(&self, [rows, columns]: &PixelBlock) -> Result<Image, ReadError> {
        let io = ReadError::io(&self.path);
        let unsuited = |what: String| ReadError::malformed(&self.path, what);
        let count = rows.len() * columns.len();
        let mut pixels = Vec::new();
        pixels
            .try_reserve_exact(count)
            .map_err(|_| unsuited(format!("no memory for {} bytes of it", 8 * count)))?;
        let mut file = self.file.lock().unwrap_or_else(|held| held.into_inner());
        let whole_rows = columns.len() == self.columns;
        let runs = if whole_rows { 1 } else { rows.len() };
        let run = if whole_rows { count } else { columns.len() };
        let mut bytes = vec![0; (8 * run).clamp(8, READ_BYTES)];
        for i in 0..runs {
            let first = (rows.start + i) * self.columns + columns.start;
            file.seek(SeekFrom::Start(self.start + 8 * first as u64))
                .map_err(&io)?;
            let mut left = run;
            while left > 0 {
                let some = left.min(bytes.len() / 8);
                let bytes = &mut bytes[..8 * some];
                file.read_exact(bytes).map_err(&io)?;
                pixels.extend(bytes.as_chunks().0.iter().map(value));
                left -= some;
            }
        }
        if let Some(how) = self.stamp.difference(&file).map_err(&io)? {
            return Err(unsuited(format!(
                "was changed while it was read ({how}): start again when it is complete"
            )));
        }
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels,
        })
    }
}

/// Decode a value of eight bytes.
fn value(&[a, b, c, d, e, f, g, h]: &[u8; 8]) -> Complex32 {
    Complex32::new(
        f32::from_le_bytes([a, b, c, d]),
        f32::from_le_bytes([e, f, g, h]),
    )
}

impl ImageSource for ImageFile {
    fn size(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    fn places(&self) -> PixelBlocks {
        bands(self.rows, self.columns)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        Ok(self.part(place)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_equal_parts_of_whole_image() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let image = Image {
            rows: 5,
            columns: 4,
            pixels: (0..20).map(|i| Complex32::new(i as f32, -1.0)).collect(),
        };
        super::super::write(&path, &image).unwrap();
        let file = ImageFile::open(&path).unwrap();
        assert_eq!(file.size(), (5, 4));
        assert_eq!(file.read().unwrap(), image);
        for place in [[1..4, 1..3], [0..5, 0..4], [4..5, 3..4], [2..4, 0..4]] {
            assert_eq!(file.window(&place).unwrap(), image.window(&place).unwrap());
        }
        // Rows longer than a read, and not a multiple of it.
        let image = Image {
            rows: 3,
            columns: 20_001,
            pixels: (0..60_003).map(|i| Complex32::new(i as f32, 0.5)).collect(),
        };
        super::super::write(&path, &image).unwrap();
        let file = ImageFile::open(&path).unwrap();
        for place in [[0..3, 0..20_001], [1..3, 7..16_500], [2..3, 1..8193]] {
            assert_eq!(file.window(&place).unwrap(), image.window(&place).unwrap());
        }
    }
}
