//! NumPy arrays: images and arrays of recordings, read and written.
//!
//! Format 1.0 (NumPy enhancement proposal 1). An image has type `<c8`, C order and two dimensions: rows (y or range
//! ascending) x columns (x or angle ascending), unchanged by `numpy.load`. [`Array`] is any numeric array, in a file
//! of its own or in an archive (`.npz`); [`ArrayWriter`] writes an array a few values at a time.
//!
//! (Why not a crate: `npyz` 0.9.1 panics on a shape whose product overflows, before a caller can see
//! the shape, and brings 36 crates with a parser of all Python literals. One kind of header is a
//! page.)

mod archive;
mod array;
mod filling;
mod half;
mod header;
mod on_disk;
mod range;
mod write;

use std::io::{self, Write};
use std::path::Path;

use self::header::Header;
use super::ReadError;
use super::atomic::{WriteError, write_atomically};
#[cfg(feature = "npz")]
use super::input::open_file;
use subaperture_model::image::Image;

pub use array::{Array, Values};
pub(crate) use filling::Filling;
#[cfg(feature = "hdf5")]
pub(crate) use half::half;
pub use on_disk::ImageFile;
#[cfg(any(feature = "hdf5", feature = "recording"))]
pub(crate) use range::Range;
pub use write::{ArrayWriter, Number};

/// Size of the file that [`write()`] writes for an image of this many pixels, in bytes.
pub fn file_bytes(num_pixels: u64) -> u64 {
    num_pixels.saturating_mul(8).saturating_add(128)
}

/// Write `image` to a stream.
///
/// # Errors
/// Errors of the stream.
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
    let mut writer = ArrayWriter::new(stream, &[rows, columns])?;
    writer.put(&image.pixels)?;
    writer.finish()
}

/// Write `image` to a file atomically.
///
/// # Errors
/// [`WriteError`].
pub fn write(path: &Path, image: &Image) -> Result<(), WriteError> {
    let bytes = file_bytes(image.pixels.len() as u64);
    write_atomically(path, bytes, |file| write_to(file, image))
}

/// Read an image. Memory is allocated only for bytes that the file contains. Values may be NaN.
///
/// # Errors
/// [`ReadError`].
pub fn read(path: &Path) -> Result<Image, ReadError> {
    ImageFile::open(path)?.read()
}

/// Names of the arrays in an archive (`.npz`), without `.npy`.
///
/// # Errors
/// [`ReadError`] if it is not an archive.
#[cfg(feature = "npz")]
pub fn names(path: &Path) -> Result<Vec<String>, ReadError> {
    let opened = open_file(path).map_err(ReadError::io(path))?;
    archive::names(&opened).map_err(|what| ReadError::malformed(path, what))
}

/// As [`names`], of an archive in memory.
#[cfg(feature = "npz")]
pub(crate) fn names_of(bytes: &[u8]) -> Result<Vec<String>, String> {
    archive::names(io::Cursor::new(bytes))
}

/// Rows and columns of a complex64 image.
fn image_shape(header: &Header) -> Result<(u64, u64), String> {
    match (
        header.kind.as_str(),
        header.order.as_str(),
        header.sizes.as_deref(),
    ) {
        ("'<c8'", "False", Some(&[rows, columns])) => Ok((rows, columns)),
        (kind, order, _) => Err(format!(
            "found type {kind}, fortran_order {order}, shape {}; expected an image, '<c8' (complex64) of two \
             dimensions in C order: numpy.ascontiguousarray(a, 'complex64')",
            header.shape
        )),
    }
}
