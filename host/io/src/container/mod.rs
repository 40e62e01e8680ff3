//! Layer shared by the formats that hold XML and large arrays in one file: CPHD, CRSD, and SICD and SIDD in NITF.
//!
//! - [`Source`]: an open file. A size or place that the file states is compared with the bytes present before memory is allocated for it.
//! - [`Block`]: a range of bytes within the file.
//! - [`Element`]: an XML element. Its errors name the path from the root, such as `CPHD/Global/SGN`.
//! - [`nitf`]: file header, segments, XML and pixels of NITF 2.1.
//! - Text header of CPHD and CRSD, their records of 8-byte words, sample formats, dates and channels (used within this crate).
//!
//! Every error is a [`ReadError`], which names the file; those about XML name the element too.
//!
//! [`ReadError`]: subaperture_model::phase_history::ReadError

mod element;
pub mod nitf;
mod source;

#[cfg(feature = "cphd")]
pub(crate) mod channels;
#[cfg(feature = "cphd")]
#[cfg(feature = "cphd")]
pub(crate) mod lines;
#[cfg(feature = "cphd")]
pub(crate) mod record;
#[cfg(feature = "cphd")]
mod samples;

pub use element::{Element, MetadataError, parse};
pub use source::{Block, Source};

#[cfg(feature = "cphd")]
pub(crate) use channels::{ChannelFile, FileChannel};
#[cfg(feature = "cphd")]
pub(crate) use lines::{Blocks, Lines, SECTION_END};
#[cfg(feature = "cphd")]
pub use samples::SignalFormat;
#[cfg(feature = "cphd")]
pub(crate) use samples::encode;
#[cfg(feature = "cphd")]
pub(crate) use source::CHUNK_BYTES;
