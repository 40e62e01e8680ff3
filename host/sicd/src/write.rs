//! Writer of SICD: metadata, and samples as big-endian float32 pairs.

use std::path::Path;

use subaperture_model::image::ImageSource;
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::describe::Description;
use crate::formed::{Formed, Georeference};
use crate::laid::Laid;
use crate::nitf::{MAX_BYTES, Product};
use crate::orientation::Orientation;
use crate::version::SicdVersion;
use crate::written::Written;

/// Options of a SICD file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SicdOptions {
    /// Version; `None` for the lowest that describes the image.
    pub version: Option<SicdVersion>,
    /// Maximum size of an image segment, for readers with a smaller limit than that of the standard, 9,999,999,998 bytes, which always applies.
    pub segment_bytes: u64,
}

impl Default for SicdOptions {
    /// The lowest version, and the standard's size of segments.
    fn default() -> Self {
        Self {
            version: None,
            segment_bytes: MAX_BYTES,
        }
    }
}

/// SICD file without its samples.
#[derive(Clone, Debug)]
pub struct Sicd(Written);

impl Sicd {
    /// Describe an image; `created_ns` is the current time, nanoseconds since 1970 (UTC).
    ///
    /// # Errors
    /// [`SicdError`] if the position is unknown, or SICD cannot describe the image or its aperture.
    pub fn new(
        formed: &Formed,
        placing: &Georeference,
        created_ns: i64,
    ) -> Result<Self, SicdError> {
        Self::with_options(formed, placing, created_ns, &SicdOptions::default())
    }

    /// As [`Self::new`], with options.
    ///
    /// # Errors
    /// [`SicdError`] as [`Self::new`]; also if the version does not describe the image, a row exceeds the size of a segment, or the image needs more than 999
    /// segments.
    pub fn with_options(
        formed: &Formed,
        placing: &Georeference,
        created_ns: i64,
        options: &SicdOptions,
    ) -> Result<Self, SicdError> {
        let laid = Laid::new(formed, placing)?;
        let version = SicdVersion::of(&laid.aperture, options.version)?;
        let xml = Description {
            version,
            formed,
            placed: &laid.placed,
            aperture: &laid.aperture,
            seen: &laid.seen,
            sensor: &laid.sensor,
            bistatic: laid.bistatic.as_ref(),
            spectra: &laid.spectra,
            corners: &laid.corners,
            created_ns,
        }
        .document();
        Ok(Self(laid.written(
            formed,
            Product::Sicd(version),
            created_ns,
            xml,
            options.segment_bytes,
        )?))
    }

    /// XML metadata.
    pub fn xml(&self) -> &str {
        &self.0.xml
    }

    /// Orientation of rows and columns relative to the image's.
    pub fn turned(&self) -> Orientation {
        self.0.turned
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
