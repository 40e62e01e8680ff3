//! Radar image formation: from phase history to a focused, measured image.
//!
//! The way of the data, left to right, with nothing flowing back:
//!
//! ```text
//! io, simulate -> phase_history -> focus -> image -> plot, io
//!                 (pulses, band)   ^ geometry (grid, patches)
//!                                  ^ signal   (windows, transforms, kernels)
//! ```
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

pub mod crosscheck;
pub mod description;
pub mod focus;
pub mod geometry;
pub mod image;
pub mod io;
pub mod link;
pub mod maps;
pub mod module;
pub mod phase_history;
pub mod planner;
pub mod plot;
pub mod quality;
pub mod quantity;
pub mod receive;
pub mod reproduce;
pub mod signal;
pub mod simulate;
pub mod support;
pub mod survey;
pub mod tune;

/// Speed of light in vacuum, metres a second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;
