//! Encoder of tiled TIFF 6.0 and BigTIFF.

mod directory;
mod predictor;
mod spool;

pub(crate) use directory::{Directory, File, Value};
pub(crate) use predictor::{bytes_differenced, floats_differenced};
pub(crate) use spool::Spool;
