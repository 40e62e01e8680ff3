//! CPHD files: written and read back, read from hand-made bytes, damaged, and checked by sarkit.

mod antenna;
mod by_hand;
mod damage;
mod reading;
mod round_trip;
mod sarkit;
pub(crate) mod scene;
