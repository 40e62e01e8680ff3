//! The image formers, a folder each.

pub mod bp;
pub mod exact;
pub mod ffbp;
pub mod omega_k;
pub mod pfa;
pub mod rda;
pub mod rdbp;
