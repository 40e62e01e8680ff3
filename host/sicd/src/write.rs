//! The file: headers, samples in strips, XML.

use std::io::{self, Write};
use std::path::Path;

use num_complex::Complex32;

use subaperture_io::atomic::Beside;
use subaperture_model::image::Parts;
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::describe::Told;
use crate::formed::{Formed, Placing};
use crate::laid::Laid;
use crate::nitf::{Headers, Product, Segment};
use crate::turned::Turned;

/// Pixels that are held of an image while it is written, about: a row at the least, and their bytes besides.
pub const STRIP_PIXELS: usize = 1 << 20;

/// A SICD but for its samples.
#[derive(Clone, Debug)]
pub struct Sicd(Written);

impl Sicd {
    /// What is told of an image; `created_ns` is now, nanoseconds since the beginning of 1970.
    ///
    /// # Errors
    /// [`SicdError`].
    pub fn new(formed: &Formed, placing: &Placing, created_ns: i64) -> Result<Self, SicdError> {
        let laid = Laid::new(formed, placing)?;
        let xml = Told {
            formed,
            placed: &laid.placed,
            aperture: &laid.aperture,
            seen: &laid.seen,
            spectra: &laid.spectra,
            corners: &laid.corners,
            created_ns,
        }
        .document();
        Ok(Self(laid.written(
            formed,
            Product::Sicd,
            created_ns,
            xml,
        )?))
    }

    /// The metadata.
    pub fn xml(&self) -> &str {
        &self.0.xml
    }

    /// How rows and columns lie on the image's.
    pub fn turned(&self) -> Turned {
        self.0.turned
    }

    /// What was assumed, in sentences: it stands in the file, too.
    pub fn told(&self) -> &[String] {
        &self.0.told
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        self.0.headers.bytes
    }

    /// Writes the file, complete or not at all, reading the image in strips.
    ///
    /// # Errors
    /// [`SicdError`]; then nothing is left behind.
    ///
    /// # Panics
    /// If the image is not of the size that was told.
    pub fn write(
        &self,
        path: &Path,
        image: &dyn Parts,
        monitor: &dyn Monitor,
    ) -> Result<(), SicdError> {
        self.0.write(path, image, monitor, |pixels, bytes| {
            for z in pixels {
                bytes.extend(z.re.to_be_bytes());
                bytes.extend(z.im.to_be_bytes());
            }
        })
    }
}

/// A file but for its samples.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub(crate) xml: String,
    pub(crate) turned: Turned,
    /// Rows and columns of the image as it is.
    pub(crate) image: (usize, usize),
    pub(crate) segments: Vec<Segment>,
    pub(crate) headers: Headers,
    /// What was assumed, in sentences.
    pub(crate) told: Vec<String>,
}

impl Written {
    /// Writes the file, complete or not at all, reading the image in strips, of whose pixels `encode` makes bytes.
    pub(crate) fn write(
        &self,
        path: &Path,
        image: &dyn Parts,
        monitor: &dyn Monitor,
        encode: impl Fn(&[Complex32], &mut Vec<u8>),
    ) -> Result<(), SicdError> {
        assert_eq!(image.size(), self.image, "the image's size");
        let mut beside = Beside::create(path, self.headers.bytes, ".part")?;
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
