//! A SICD: metadata, and samples as big-endian pairs of float32.

use std::path::Path;

use subaperture_model::image::Parts;
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::describe::Told;
use crate::formed::{Formed, Placing};
use crate::laid::Laid;
use crate::nitf::{MOST_BYTES, Product};
use crate::turned::Turned;
use crate::written::Written;

/// A SICD but for its samples.
#[derive(Clone, Debug)]
pub struct Sicd(Written);

impl Sicd {
    /// What is told of an image; `created_ns` is now, nanoseconds since the beginning of 1970.
    ///
    /// # Errors
    /// [`SicdError`].
    pub fn new(formed: &Formed, placing: &Placing, created_ns: i64) -> Result<Self, SicdError> {
        Self::in_segments(formed, placing, created_ns, MOST_BYTES)
    }

    /// The same, of whose samples no segment of the file holds more than `segment_bytes`, for whoever cannot take as many as the standard allows at
    /// once; those that it allows are the most in any case.
    ///
    /// # Errors
    /// [`SicdError`], also where a row has more or 999 segments do not hold the image.
    pub fn in_segments(
        formed: &Formed,
        placing: &Placing,
        created_ns: i64,
        segment_bytes: u64,
    ) -> Result<Self, SicdError> {
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
            segment_bytes,
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
