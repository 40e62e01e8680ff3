//! Complex images as SICD (NGA.STND.0024) in NITF 2.1, written as version 1.3 and read of any: what other programs measure, project and show them by. A part of
//! [Subaperture](https://docs.rs/subaperture), whose crate `subaperture` has it as its module `sicd`.
//!
//! ```text
//! image.json ── Formed::of_record ─┐
//! a place and a time, if asked ────┴─> Sicd::new, Sidd::new ── write(image, part by part) ──> one file: headers, samples, XML
//! ```
//!
//! **What is told.** Our images lie on Cartesian grids in a plane, formed in space and not in a spectrum: `Grid/Type` is `PLANE`, and `ImageFormAlgo` is `OTHER` for every
//! former, with its name under `Processing`, for the blocks PFA, RMA and RgAzComp describe images whose pixels are somewhere else. All pixels are seen by all pulses, so that the
//! centre of aperture is one moment, the middle of the recording's time.
//!
//! **Samples** are those of the image, to the bit, as big-endian float32 pairs. Rows run away from the radar and columns so that the plane's normal is up, as the standard wants it
//! (shadows fall down): the image is turned by quarters ([`Turned`]). A pixel's phase refers to its own path, so its spectrum lies around `K = f / c (u_t + u_r)` and not around zero.
//! `KCtr` is that multiple of `1 / SS` which is nearest to it: at the samples the carrier of such a frequency is 1, and what remains is
//! told by `DeltaKCOAPoly`. `Sgn` is -1.
//!
//! **Frame.** An image of a recording that does not know where on the Earth it was is put where it is told ([`Placing`]).
//!
//! **SIDD.** [`Sidd`] is the same image detected: bytes of grey on the same plane, as version 3.0.
//!
//! **Reading.** [`SicdFile`] reads anyone's, part by part; [`Projection`] tells where on the Earth its pixels are.
//!
//! **Cost** that of reading the image and writing it once, in strips of [`STRIP_PIXELS`]; images over 10 GB are parted in segments.
//!
//! **Errors** [`SicdError`]: nothing is written where the metadata would say what is not so.
#![forbid(unsafe_code)]

mod aperture;
mod band;
mod dates;
mod describe;
mod formed;
mod grid;
mod header;
mod laid;
mod lookup;
mod nitf;
mod plane;
mod polynomial;
mod projection;
mod read;
mod sidd;
mod spectrum;
mod turned;
mod write;
mod written;

pub use band::Band;
pub use formed::{Formed, Placing};
pub use plane::Plane;
pub use projection::{Projection, ProjectionError};
pub use read::{MOST_XML_BYTES, ReadError, SicdFile};
pub use sidd::{Greys, Sidd};
pub use turned::Turned;
pub use write::Sicd;
pub use written::STRIP_PIXELS;

use subaperture_io::atomic::WriteError;
use subaperture_model::image::PartsError;

/// Why there is no SICD.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SicdError {
    /// Nothing says where on the Earth the scene is.
    #[error("the recording does not say where on the Earth its scene is")]
    Nowhere,
    /// The record of the image lacks something.
    #[error("the image's record does not hold {0}: form it again by this version")]
    Record(&'static str),
    /// The image cannot be told of in SICD.
    #[error("{0}")]
    Unsuited(String),
    /// The image could not be read.
    #[error("the image: {0}")]
    Read(PartsError),
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// It was asked to stop.
    #[error("cancelled")]
    Cancelled,
}
