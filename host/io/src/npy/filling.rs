//! An image whose `.npy` file is filled place by place, in any order.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use num_complex::Complex32;

use super::write::{Number, header};
use subaperture_model::image::PixelBlock;

/// A file of the image's full size, of zeros where nothing was put.
#[derive(Debug)]
pub(crate) struct Filling {
    file: File,
    /// Bytes before the values.
    start: u64,
    columns: usize,
}

impl Filling {
    /// Makes an empty file one of an image of these rows and columns.
    pub(crate) fn begin(mut file: File, [rows, columns]: [usize; 2]) -> io::Result<Self> {
        let header = header::<Complex32>(&[rows, columns]);
        file.write_all(&header)?;
        let start = header.len() as u64;
        file.set_len(start + 8 * rows as u64 * columns as u64)?;
        Ok(Self {
            file,
            start,
            columns,
        })
    }

    /// Writes a place's pixels, row-major.
    pub(crate) fn put(&mut self, place: &PixelBlock, pixels: &[Complex32]) -> io::Result<()> {
        let [rows, columns] = place;
        assert_eq!(
            pixels.len(),
            rows.len() * columns.len(),
            "pixels of {place:?}"
        );
        for (row, values) in rows.clone().zip(pixels.chunks_exact(columns.len().max(1))) {
            let first = (row * self.columns + columns.start) as u64;
            self.file.seek(SeekFrom::Start(self.start + 8 * first))?;
            let mut out = BufWriter::with_capacity(1 << 16, &mut self.file);
            values.iter().try_for_each(|z| z.write(&mut out))?;
            out.flush()?;
        }
        Ok(())
    }

    /// The file.
    pub(crate) fn into_file(self) -> File {
        self.file
    }
}
