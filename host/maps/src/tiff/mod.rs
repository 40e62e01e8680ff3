//! TIFF 6.0 and BigTIFF, as far as tiled rasters need them.

mod directory;
mod predictor;
mod spool;

pub(crate) use directory::{Directory, File, Value};
pub(crate) use predictor::{bytes_differenced, floats_differenced};
pub(crate) use spool::Spool;
