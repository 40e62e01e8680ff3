//! Reader and writer of SICD (NGA.STND.0024) complex images and SIDD (NGA.STND.0025) detected images in NITF 2.1. SICD is written as version 1.3, of a bistatic radar as
//! 1.4, and read as version 0.4 to 1.5.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), whose crate `subaperture` has it as its module `sicd`.
//!
//! ```text
//! image.json ── Formed::of_record ─┐
//! position and time, if given ─────┴─> Sicd::new, Sidd::new ── write(image, strip by strip) ──> one file: headers, samples, XML
//! ```
//!
//! **Metadata.** Images lie on Cartesian grids in a plane: `Grid/Type` is `PLANE`. `ImageFormAlgo` is `OTHER` for every image former, with its name under
//! `Processing`, because the blocks PFA, RMA and RgAzComp describe other pixel positions. All pixels see all pulses, so that the centre of aperture (COA) is one
//! time, the middle of the recording.
//!
//! **Samples** are bit-identical to those of the image, as big-endian float32 pairs. Rows run away from the radar and the plane's normal points up, as the standard
//! requires (shadows fall down): the image is rotated in steps of 90 degrees ([`Orientation`]). The phase of a pixel refers to its own path, so its spectrum lies about
//! `K = f / c (u_t + u_r)` and not about zero. `KCtr` is the multiple of `1 / SS` nearest to it: a carrier of that frequency is 1 at the samples, and `DeltaKCOAPoly`
//! describes the remainder. `Sgn` is -1.
//!
//! **Bistatic images**, with transmitter and receiver more than a milliradian apart seen from the scene, are written as version 1.4 by default ([`SicdOptions`]): it defines `SCPCOA/Bistatic`, and
//! 1.5 adds only polygons of areas. `CollectType` is `BISTATIC`; `Position` contains `TxAPCPoly` at times of transmission, `RcvAPC` at times of reception, and the scene centre
//! point as `GRPPoly`. `ARPPoly` runs on the bisector of the directions to both antennas, at the mean of their ranges, and times of centre of aperture are those at the
//! scene. `IlluminatorName` is `UNKNOWN`. Refused are recordings without pulse times, bistatic angles of 168 degrees and more, and bisectors that do not turn.
//! A fixed antenna has a `DopplerConeAng` of 90 degrees. SIDD describes monostatic images only.
//!
//! **Frame.** The caller gives the position of an image whose recording contains none ([`Georeference`]).
//!
//! **SIDD.** [`Sidd`] is the detected image, 8-bit grey on the same plane, version 3.0.
//!
//! **Reading.** [`SicdFile`] and [`SiddFile`] read files of any producer, window by window; [`Projection`] projects pixels to the Earth.
//!
//! **Cost** one read and one write of the image, in strips of [`STRIP_PIXELS`]; images over 10 GB are divided into segments.
//!
//! **Errors** [`SicdError`]: no file is written where the metadata would be wrong.
#![forbid(unsafe_code)]

mod aperture;
mod band;
mod bistatic;
mod contour;
mod dates;
mod describe;
mod formed;
mod grid;
mod header;
mod laid;
mod lookup;
mod nitf;
mod orientation;
mod pair;
mod plane;
mod polynomial;
mod projection;
mod read;
mod sidd;
mod spectrum;
mod version;
mod write;
mod written;

pub use band::Band;
pub use subaperture_io::container::nitf::MAX_XML_BYTES;
pub use subaperture_model::phase_history::ReadError;

pub use formed::{Formed, Georeference};
pub use orientation::Orientation;
pub use plane::Plane;
pub use projection::{Projection, ProjectionError};
pub use read::SicdFile;
pub use sidd::{Greys, Sidd, SiddFile, is_sidd};
pub use version::{SicdVersion, UnknownVersion};
pub use write::{Sicd, SicdOptions};
pub use written::STRIP_PIXELS;

use subaperture_io::atomic::WriteError;
use subaperture_model::image::ImageSourceError;

/// Error of writing a SICD or SIDD.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SicdError {
    /// The scene's position on the Earth is unknown.
    #[error("the recording does not contain the scene's position on the Earth; state it")]
    Nowhere,
    /// The image's record lacks an item.
    #[error("the image's record does not contain {0}; form the image again with this version")]
    Record(&'static str),
    /// The image or its aperture cannot be described in SICD.
    #[error("{0}")]
    Unsuited(String),
    /// The image could not be read.
    #[error("the image: {0}")]
    Read(ImageSourceError),
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Cancelled by the monitor.
    #[error("cancelled")]
    Cancelled,
}
