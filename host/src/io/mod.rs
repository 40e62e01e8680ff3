//! Files: recordings in, images out.

pub mod atomic;
pub mod cphd;
pub mod gotcha;
pub mod maps;
mod matlab;
pub mod motive;
pub mod novatel;
pub mod npy;
pub mod open;
pub mod product;
pub mod recording;
mod staging;
pub mod track_axes;
pub mod track_csv;
