//! Common types of image formation: phase history, geometry, radar, track, grid, image, units.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture` re-exports
//! these modules.
//!
//! | module | contents |
//! |---|---|
//! | [`geometry`] | scene frame, positions on the Earth, image grids |
//! | [`phase_history`] | pulses, collections, channels: the input of formers |
//! | [`antenna`] | position, direction and pattern of antennas |
//! | [`radar`] | waveform, timing, impairments of receivers |
//! | [`resolution`] | spectral support, resolution, sampling and default grid of a collection |
//! | [`track`] | trajectories of radars and targets |
//! | [`image`] | complex images, and the error between two of them |
//! | [`units`], [`quantity`] | numbers with units, parsed and printed |
//! | [`stopwatch`] | elapsed time of work |
//! | [`monitor`] | progress and cancellation of long work |
//! | [`nearest`] | nearest valid name of a misspelt one |
//!
//! # Conventions
//! - The phase of a unit scatterer at `p` in pulse `n` at frequency `f` is
//!   `-2 pi f (path_n(p) - reference_path_n) / c`: Schone 2020 (2.11), CPHD's `SGN = -1`. Every reader converts to
//!   this convention.
//! - A *path* is the two-way length from transmitter to point to receiver, in metres.
//! - Positions are metres in the scene frame ([`geometry::SceneFrame`]), float64; samples are
//!   complex float32.
//! - Names carry units: `_m`, `_s`, `_hz`, `_rad`, `_db`.
#![forbid(unsafe_code)]

pub mod antenna;
pub mod geometry;
pub mod image;
pub mod monitor;
pub mod nearest;
pub mod phase_history;
pub mod quantity;
pub mod radar;
pub mod resolution;
pub mod stopwatch;
pub mod track;
pub mod units;

/// Speed of light in vacuum, metres per second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Program name written into files.
pub const PROGRAM: &str = "subap";
