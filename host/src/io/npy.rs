//! NumPy arrays of complex64, read and written, and of real numbers, read.
//!
//! Format 1.0 (NumPy enhancement proposal 1), type `<c8`, C order, two dimensions: rows (y or range
//! ascending) x columns (x or angle ascending). `numpy.load` gives the image as it is here. Real arrays
//! are `<f4`, `<f8`, `|u1` or `<u2`, and are read as float32.
//!
//! (Why not a crate: `npyz` 0.9.1 panics on a shape whose product overflows, before a caller can see
//! the shape, and brings 36 crates with a parser of all Python literals. One kind of header is a
//! page.)

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use num_complex::Complex32;

use super::atomic::{WriteError, write_atomically};
use crate::image::Image;

const MAGIC: &[u8] = b"\x93NUMPY";

/// Why an array was not read.
#[derive(Debug, thiserror::Error)]
pub enum NpyError {
    /// The operating system refused.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File concerned.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// Not a complex64 image.
    #[error("{path}: {what}")]
    Unsuited {
        /// File concerned.
        path: PathBuf,
        /// What it is, and what was expected.
        what: String,
    },
}

/// Bytes of the file that [`write()`] makes of an image of this many pixels.
pub fn file_bytes(num_pixels: u64) -> u64 {
    num_pixels.saturating_mul(8).saturating_add(128)
}

/// Writes `image` to a stream.
///
/// # Errors
/// Those of the stream.
pub fn write_to(stream: impl Write, image: &Image) -> io::Result<()> {
    let (rows, columns) = (image.rows, image.columns);
    if rows.checked_mul(columns) != Some(image.pixels.len()) {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!(
                "an image of {rows} x {columns} with {} pixels",
                image.pixels.len()
            ),
        ));
    }
    let mut header =
        format!("{{'descr': '<c8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // NumPy wants the data to begin at a multiple of 64, behind a newline.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header = format!("{header:<width$}\n", width = length - 1);
    let mut stream = BufWriter::new(stream);
    stream.write_all(MAGIC)?;
    stream.write_all(&[1, 0])?;
    stream.write_all(&(length as u16).to_le_bytes())?;
    stream.write_all(header.as_bytes())?;
    for z in &image.pixels {
        stream.write_all(&z.re.to_le_bytes())?;
        stream.write_all(&z.im.to_le_bytes())?;
    }
    stream.flush()
}

/// Writes `image` to a file, complete or not at all.
///
/// # Errors
/// [`WriteError`].
pub fn write(path: &Path, image: &Image) -> Result<(), WriteError> {
    let bytes = file_bytes(image.pixels.len() as u64);
    write_atomically(path, bytes, |file| write_to(file, image))
}

/// Real numbers on a rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct RealArray {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Values, row by row.
    pub values: Vec<f32>,
}

/// Reads an image. No more memory is asked for than the file has bytes. Values are not checked:
/// they may be NaN.
///
/// # Errors
/// [`NpyError`].
pub fn read(path: &Path) -> Result<Image, NpyError> {
    let (array, data) = Array::open(path)?;
    if array.kind != "'<c8'" {
        return Err(array.unsuited(
            path,
            "an image, '<c8' (complex64) of two dimensions in C order, is expected: \
             numpy.ascontiguousarray(a, 'complex64')",
        ));
    }
    let pixels = array.values(path, data, |[a, b, c, d, e, f, g, h]| {
        Complex32::new(
            f32::from_le_bytes([a, b, c, d]),
            f32::from_le_bytes([e, f, g, h]),
        )
    })?;
    Ok(Image {
        rows: array.rows as usize,
        columns: array.columns as usize,
        pixels,
    })
}

/// Reads a real array. No more memory is asked for than four times the file's bytes. Values are not
/// checked: they may be NaN.
///
/// # Errors
/// [`NpyError`].
pub fn read_real(path: &Path) -> Result<RealArray, NpyError> {
    let (array, data) = Array::open(path)?;
    let values = match array.kind.as_str() {
        "'<f4'" => array.values(path, data, f32::from_le_bytes)?,
        "'<f8'" => array.values(path, data, |b| f64::from_le_bytes(b) as f32)?,
        "'|u1'" => array.values(path, data, |[b]| f32::from(b))?,
        "'<u2'" => array.values(path, data, |b| f32::from(u16::from_le_bytes(b)))?,
        _ => {
            return Err(array.unsuited(
                path,
                "real numbers ('<f4', '<f8', '|u1' or '<u2') of two dimensions in C order are expected: \
                 numpy.ascontiguousarray(a, 'float32')",
            ));
        }
    };
    Ok(RealArray {
        rows: array.rows as usize,
        columns: array.columns as usize,
        values,
    })
}

/// What a file's header says, and how much follows it.
struct Array {
    kind: String,
    rows: u64,
    columns: u64,
    data_bytes: u64,
}

impl Array {
    /// Opens a file and reads its header; the reader stands behind it.
    fn open(path: &Path) -> Result<(Self, BufReader<File>), NpyError> {
        let io = |source: io::Error| NpyError::Io {
            path: path.to_owned(),
            source,
        };
        let unsuited = |what: String| NpyError::Unsuited {
            path: path.to_owned(),
            what,
        };
        let file = File::open(path).map_err(io)?;
        let file_bytes = file.metadata().map_err(io)?.len();
        let mut reader = BufReader::new(file);

        let mut start = Vec::new();
        reader
            .by_ref()
            .take(10)
            .read_to_end(&mut start)
            .map_err(io)?;
        let header_bytes = match start.strip_prefix(MAGIC) {
            Some(&[1, 0, low, high]) => u16::from_le_bytes([low, high]),
            Some([1, 0, ..]) => return Err(unsuited("truncated within its header".to_owned())),
            Some([major, minor, ..]) => {
                return Err(unsuited(format!(
                    "NumPy format {major}.{minor}; 1.0, as numpy.save writes of a plain array, is read"
                )));
            }
            _ => return Err(unsuited("not a NumPy array file (.npy)".to_owned())),
        };
        let mut header = Vec::new();
        reader
            .by_ref()
            .take(u64::from(header_bytes))
            .read_to_end(&mut header)
            .map_err(io)?;
        if header.len() < usize::from(header_bytes) {
            return Err(unsuited("truncated within its header".to_owned()));
        }
        let (kind, rows, columns) =
            parse_header(&String::from_utf8_lossy(&header)).map_err(unsuited)?;
        let array = Self {
            kind,
            rows,
            columns,
            data_bytes: file_bytes.saturating_sub(10 + u64::from(header_bytes)),
        };
        Ok((array, reader))
    }

    fn unsuited(&self, path: &Path, expected: &str) -> NpyError {
        NpyError::Unsuited {
            path: path.to_owned(),
            what: format!(
                "holds type {}, fortran_order False, shape ({}, {}); {expected}",
                self.kind, self.rows, self.columns
            ),
        }
    }

    /// All values, of `N` bytes each.
    fn values<const N: usize, T>(
        &self,
        path: &Path,
        mut data: BufReader<File>,
        value: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, NpyError> {
        let unsuited = |what: String| NpyError::Unsuited {
            path: path.to_owned(),
            what,
        };
        // Below 2^128 as it stands, but not with the values' bytes.
        let needed = (u128::from(self.rows) * u128::from(self.columns)).saturating_mul(N as u128);
        if needed != u128::from(self.data_bytes) {
            return Err(unsuited(format!(
                "{} x {} values of type {} need {needed} bytes after the header, but the file has {}",
                self.rows, self.columns, self.kind, self.data_bytes
            )));
        }
        let count = (self.data_bytes / N as u64) as usize;
        let mut values = Vec::new();
        values
            .try_reserve_exact(count)
            .map_err(|_| unsuited(format!("no memory for its {needed} bytes")))?;
        for _ in 0..count {
            let mut bytes = [0; N];
            data.read_exact(&mut bytes).map_err(|source| NpyError::Io {
                path: path.to_owned(),
                source,
            })?;
            values.push(value(bytes));
        }
        Ok(values)
    }
}

/// Type, rows and columns of a header, a Python dictionary with just the keys `descr`, `fortran_order`
/// and `shape` in any order.
fn parse_header(text: &str) -> Result<(String, u64, u64), String> {
    let compact: String = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| if c == '"' { '\'' } else { c })
        .collect();
    let value = |key: &str| {
        let (_, rest) = compact.split_once(&format!("'{key}':"))?;
        let end = match rest.strip_prefix('(') {
            Some(inside) => inside.find(')')? + 2,
            None => rest.find([',', '}'])?,
        };
        Some(&rest[..end])
    };
    let (Some(kind), Some(order), Some(shape)) =
        (value("descr"), value("fortran_order"), value("shape"))
    else {
        return Err(
            "its NumPy header is damaged, or not that of a plain array: keys descr, fortran_order \
             and shape are expected"
                .to_owned(),
        );
    };
    let sizes: Option<Vec<u64>> = shape.strip_prefix('(').and_then(|s| {
        let inside = s.strip_suffix(')')?;
        let sizes = inside.strip_suffix(',').unwrap_or(inside).split(',');
        sizes.map(|size| size.parse().ok()).collect()
    });
    match (order, sizes.as_deref()) {
        ("False", Some(&[rows, columns])) => Ok((kind.to_owned(), rows, columns)),
        _ => Err(format!(
            "holds type {kind}, fortran_order {order}, shape {shape}; two dimensions in C order are \
             expected: numpy.ascontiguousarray(a, 'complex64') of an image"
        )),
    }
}
