//! Image file (`.npy`) that is filled in any order.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use num_complex::Complex32;

use super::write::{Number, header};
use subaperture_model::image::PixelBlock;

/// File of the full image size; pixels not yet written are zero.
#[derive(Debug)]
pub(crate) struct Filling {
    file: File,
    /// Size of the header in bytes.
    start: u64,
    columns: usize,
}

impl Filling {
    /// Turn an empty file into an image of zeros with these rows and columns.
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

    /// Write the pixels of a block, row-major.
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

    /// Return the file.
    pub(crate) fn into_file(self) -> File {
        self.file
    }
}
