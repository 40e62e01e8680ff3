//! Files: recordings in, images out.
#![forbid(unsafe_code)]

pub mod atomic;
pub mod claim;
pub mod cphd;
pub mod gotcha;
pub mod input;
pub mod lock;
mod matlab;
pub mod motive;
pub mod novatel;
pub mod npy;
pub mod open;
pub mod ours;
pub mod place;
pub mod product;
pub mod recorded_track;
pub mod recording;
pub mod staging;
pub mod tiles;
pub mod track_axes;
pub mod track_csv;
pub mod unfinished;
