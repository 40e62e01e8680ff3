//! Writer of SIDD 3.0 (NGA.STND.0025) detected images: 8-bit grey on the image's own plane.
//!
//! Plane, rows and columns are those of the image's SICD (`PlaneProjection`). The caller defines the greys ([`Greys`]); no look-up table, filter or
//! adjustment remains for the display. Segments and headers are those of SICD, with one byte per pixel.

mod angles;
mod describe;
mod greys;
mod read;

pub use read::{SiddFile, is_sidd};

use std::path::Path;

use subaperture_model::image::{ImageSource, power};
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::formed::{Formed, Georeference};
use crate::laid::Laid;
use crate::nitf::{MAX_BYTES, Product};
use crate::written::Written;

pub use greys::Greys;

/// SIDD file without its pixels.
#[derive(Clone, Debug)]
pub struct Sidd(Written);

impl Sidd {
    /// Describe an image; `created_ns` is the current time, nanoseconds since 1970 (UTC).
    ///
    /// # Errors
    /// [`SicdError`] if the position is unknown, or SIDD cannot describe the image or its aperture.
    pub fn new(
        formed: &Formed,
        placing: &Georeference,
        greys: &Greys,
        created_ns: i64,
    ) -> Result<Self, SicdError> {
        let laid = Laid::new(formed, placing)?;
        if laid.bistatic.is_some() {
            return Err(SicdError::Unsuited(
                "transmitter and receiver are more than a milliradian apart seen from the scene; SIDD describes monostatic images: write SICD".to_owned(),
            ));
        }
        let xml = describe::document(formed, &laid, greys, created_ns);
        Ok(Self(laid.written(
            formed,
            Product::Sidd,
            created_ns,
            xml,
            MAX_BYTES,
        )?))
    }

    /// XML metadata.
    pub fn xml(&self) -> &str {
        &self.0.xml
    }

    /// Assumptions, one sentence each; the file contains them too.
    pub fn assumptions(&self) -> &[String] {
        &self.0.assumed
    }

    /// Size of the file, bytes.
    pub fn bytes(&self) -> u64 {
        self.0.headers.bytes
    }

    /// Write the file atomically, reading the image in strips.
    ///
    /// # Errors
    /// [`SicdError`] if the image cannot be read, the file cannot be written, or the monitor cancels; no file is left behind.
    ///
    /// # Panics
    /// If the size of `image` differs from that described.
    pub fn write(
        &self,
        path: &Path,
        image: &dyn ImageSource,
        greys: &Greys,
        monitor: &dyn Monitor,
    ) -> Result<(), SicdError> {
        self.0.write(path, image, monitor, |pixels, bytes| {
            bytes.extend(pixels.iter().map(|&z| (greys.of)(power(z) as f32)));
        })
    }
}
