//! Detected images as SIDD (NGA.STND.0025) 3.0: bytes of grey on the image's own plane, with what it takes to place and to read them.
//!
//! The same plane, rows and columns as the SICD of the image: a `PlaneProjection`. Greys are the caller's ([`Greys`]), which says what they are; no look-up table, filter or
//! adjustment is left to whoever shows it. Volume 2's parting and headers are those of SICD's, of one byte a pixel.

mod angles;
mod describe;

use std::path::Path;

use subaperture_model::image::{Parts, power};
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::formed::{Formed, Placing};
use crate::laid::Laid;
use crate::nitf::{MOST_BYTES, Product};
use crate::written::Written;

/// How power becomes grey.
#[derive(Clone, Copy)]
pub struct Greys<'a> {
    /// What it is called, such as `Density`.
    pub name: &'a str,
    /// Levels of black and white, dB of magnitude.
    pub levels_db: [f64; 2],
    /// The grey of a power; 0 of what is no number.
    pub of: &'a dyn Fn(f32) -> u8,
}

/// A SIDD but for its pixels.
#[derive(Clone, Debug)]
pub struct Sidd(Written);

impl Sidd {
    /// What is told of an image; `created_ns` is now, nanoseconds since the beginning of 1970.
    ///
    /// # Errors
    /// [`SicdError`].
    pub fn new(
        formed: &Formed,
        placing: &Placing,
        greys: &Greys,
        created_ns: i64,
    ) -> Result<Self, SicdError> {
        let laid = Laid::new(formed, placing)?;
        let xml = describe::document(formed, &laid, greys, created_ns);
        Ok(Self(laid.written(
            formed,
            Product::Sidd,
            created_ns,
            xml,
            MOST_BYTES,
        )?))
    }

    /// The metadata.
    pub fn xml(&self) -> &str {
        &self.0.xml
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
        greys: &Greys,
        monitor: &dyn Monitor,
    ) -> Result<(), SicdError> {
        self.0.write(path, image, monitor, |pixels, bytes| {
            bytes.extend(pixels.iter().map(|&z| (greys.of)(power(z) as f32)));
        })
    }
}
