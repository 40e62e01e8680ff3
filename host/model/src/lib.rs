//! What every part of image formation speaks of, and nothing that any of them does.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has these modules as its own.
//!
//! | module | what it holds |
//! |---|---|
//! | [`geometry`] | the scene frame, places on the Earth, image grids |
//! | [`phase_history`] | pulses, collections, channels: what formers take and readers deliver |
//! | [`radar`] | waveform, antennas, what a receiver adds |
//! | [`track`] | how radars and targets move |
//! | [`image`] | complex images, and how far apart two of them are |
//! | [`units`], [`quantity`] | numbers with units, read and written |
//! | [`monitor`] | how long work tells how far it is, and is stopped |
//! | [`nearest`] | the name that was meant by a misspelt one |
//!
//! # Conventions
//! - The phase of a unit scatterer at `p` in pulse `n` at frequency `f` is
//!   `-2 pi f (path_n(p) - reference_path_n) / c`: Schone 2020 (2.11), CPHD's `SGN = -1`.
//!   Every reader converts to it once; nothing behind the door asks again.
//! - A *path* is the two-way length from transmitter to point to receiver, in metres.
//! - Positions are metres in the scene frame ([`geometry::SceneFrame`]), float64; samples are
//!   complex float32.
//! - Names carry units: `_m`, `_s`, `_hz`, `_rad`, `_db`.
#![forbid(unsafe_code)]

pub mod geometry;
pub mod image;
pub mod monitor;
pub mod nearest;
pub mod phase_history;
pub mod quantity;
pub mod radar;
pub mod track;
pub mod units;

/// Speed of light in vacuum, metres a second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// What files are marked with.
pub const PROGRAM: &str = "subap";
