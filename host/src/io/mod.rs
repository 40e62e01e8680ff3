//! Files: recordings in, images out.

pub mod atomic;
pub mod claim;
pub mod cphd;
pub mod gotcha;
mod input;
mod lock;
pub mod maps;
mod matlab;
pub mod motive;
pub mod novatel;
pub mod npy;
pub mod open;
pub mod ours;
mod place;
pub mod product;
pub mod recording;
mod staging;
pub mod track_axes;
pub mod track_csv;
pub mod unfinished;
