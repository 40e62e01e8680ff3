//! File writer: headers, samples in strips, XML.

use std::io::{self, Write};
use std::path::Path;

use num_complex::Complex32;

use subaperture_io::atomic::AtomicFile;
use subaperture_model::image::ImageSource;
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::nitf::{Headers, Segment};
use crate::orientation::Orientation;

/// Approximate number of pixels held while an image is written; at least one row.
pub const STRIP_PIXELS: usize = 1 << 20;

/// File without its samples.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub(crate) xml: String,
    pub(crate) turned: Orientation,
    /// Rows and columns of the source image.
    pub(crate) image: (usize, usize),
    pub(crate) segments: Vec<Segment>,
    pub(crate) headers: Headers,
    /// Assumptions, one sentence each.
    pub(crate) assumed: Vec<String>,
}

impl Written {
    /// Write the file atomically, reading the image in strips; `encode` converts pixels to bytes.
    pub(crate) fn write(
        &self,
        path: &Path,
        image: &dyn ImageSource,
        monitor: &dyn Monitor,
        encode: impl Fn(&[Complex32], &mut Vec<u8>),
    ) -> Result<(), SicdError> {
        assert_eq!(image.size(), self.image, "the image's size");
        let mut beside = AtomicFile::create(path, self.headers.bytes, ".part")?;
        let mut put = |bytes: &[u8]| -> Result<(), SicdError> {
            let wrote = beside.file().write_all(bytes);
            wrote.map_err(|source: io::Error| beside.failed(source).into())
        };
        put(&self.headers.file)?;
        let [rows, columns] = self.turned.size(self.image);
        let strip = (STRIP_PIXELS / columns.max(1)).max(1);
        for (segment, header) in self.segments.iter().zip(&self.headers.images) {
            put(header)?;
            let end = (segment.first + segment.rows) as usize;
            for from in (segment.first as usize..end).step_by(strip) {
                if monitor.cancelled() {
                    return Err(SicdError::Cancelled);
                }
                let read = self.turned.rows(image, from, (from + strip).min(end));
                let pixels = read.map_err(SicdError::Read)?;
                let mut bytes = Vec::new();
                encode(&pixels, &mut bytes);
                put(&bytes)?;
                monitor.progress((from + strip).min(end) as f64 / rows as f64);
            }
        }
        put(&self.headers.xml)?;
        put(self.xml.as_bytes())?;
        Ok(beside.commit()?)
    }
}
