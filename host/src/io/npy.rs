//! NumPy arrays of complex64, read and written.
//!
//! Format 1.0 (NumPy enhancement proposal 1), type `<c8`, C order, two dimensions: rows (y or range
//! ascending) x columns (x or angle ascending). `numpy.load` gives the image as it is here.
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

/// Reads an image. No more memory is asked for than the file has bytes. Values are not checked:
/// they may be NaN.
///
/// # Errors
/// [`NpyError`].
pub fn read(path: &Path) -> Result<Image, NpyError> {
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
    let (rows, columns) = parse_header(&String::from_utf8_lossy(&header)).map_err(unsuited)?;
    let needed = u128::from(rows) * u128::from(columns) * 8;
    let present = file_bytes.saturating_sub(10 + u64::from(header_bytes));
    if needed != u128::from(present) {
        return Err(unsuited(format!(
            "{rows} x {columns} complex64 values need {needed} bytes after the header, but the file \
             has {present}"
        )));
    }
    let count = (present / 8) as usize;
    let mut pixels = Vec::new();
    pixels
        .try_reserve_exact(count)
        .map_err(|_| unsuited(format!("no memory for its {needed} bytes")))?;
    for _ in 0..count {
        let mut z = [0; 8];
        reader.read_exact(&mut z).map_err(io)?;
        let [a, b, c, d, e, f, g, h] = z;
        pixels.push(Complex32::new(
            f32::from_le_bytes([a, b, c, d]),
            f32::from_le_bytes([e, f, g, h]),
        ));
    }
    Ok(Image {
        rows: rows as usize,
        columns: columns as usize,
        pixels,
    })
}

/// Rows and columns of a complex64 image's header, a Python dictionary with just the keys `descr`,
/// `fortran_order` and `shape` in any order.
fn parse_header(text: &str) -> Result<(u64, u64), String> {
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
    match (kind, order, sizes.as_deref()) {
        ("'<c8'", "False", Some(&[rows, columns])) => Ok((rows, columns)),
        _ => Err(format!(
            "holds type {kind}, fortran_order {order}, shape {shape}; an image, '<c8' (complex64) of \
             two dimensions in C order, is expected: numpy.ascontiguousarray(a, 'complex64')"
        )),
    }
}
