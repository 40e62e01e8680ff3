//! Files: recordings in, images out.

pub mod cphd;
pub mod gotcha;
pub mod npy;
pub mod product;
