//! Radar motion and target positions from echo phases (MPGA, motion by phase gradients of arrays).
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation: module `motion` of the crate `subaperture`.
//!
//! | | method | drift | use |
//! |---|---|---|---|
//! | (a) [`pairwise`] | two linear least squares between neighbouring pulses (Chim 2018, chapter 7) | yes; biased short by errors of the angles | embedded module: the core implements it too |
//! | (b) [`robust`] | nonlinear, exact path lengths, unbiased, outliers excluded | yes | increments with covariance in changing scenes |
//! | (c) [`tracker`], [`joint`] | least squares of all poses and targets together | least | tracks at the Cramer-Rao bound |
//!
//! RMS error of the distance from the first pose to the last, over its Cramer-Rao bound: 77 GHz, 1 m in 1000 pulses, 4 reflectors at 2 to 5 m, receivers half a wavelength apart, 50 seeds
//! (`tests/increments.rs`, `tests/main.rs`):
//!
//! | receivers | SNR, dB | bound, mm | (a) | (b) | (c) | mean of (b) over its spread |
//! |---|---|---|---|---|---|---|
//! | 2 | 15 | 0.134 | 54 | 33 | 0.94 | 0.003 |
//! | 2 | 20 | 0.075 | 36 | 31 | 0.92 | 0.05 |
//! | 2 | 30 | 0.024 | 27 | 30 | 0.91 | 0.06 |
//! | 2 | 40 | 0.0076 | 26 | 30 | 0.91 | 0.06 |
//! | 4 | 15 | 0.111 | 10 | 9.0 | 0.99 | -0.04 |
//! | 4 | 20 | 0.062 | 8.9 | 9.0 | 0.99 | -0.04 |
//! | 4 | 30 | 0.020 | 8.4 | 9.0 | 0.99 | -0.04 |
//! | 4 | 40 | 0.0063 | 8.6 | 8.9 | 0.98 | -0.04 |
//!
//! [`diagnosis`] checks sightings before a track is estimated. [`movers`] finds moving targets and their velocities, [`live`] does so online. [`squint`] estimates the mounting angle of the array.
//!
//! [`targets`] finds targets in range profiles, follows them from pulse to pulse, and solves the track from their sightings.
//!
//! **Frame.** A plane with its origin at the first position of the radar. Its orientation is such that the first target lies in its first direction of arrival at a heading of 0. Height
//! differences are not modelled: they appear as additional range.
//!
//! **Phase.** The phase of an echo falls by `2 pi / wavelength` a metre of path.
#![forbid(unsafe_code)]

pub mod arrival;
mod check;
pub mod diagnosis;
pub mod increment;
pub mod joint;
pub mod live;
pub mod model;
pub mod movers;
pub mod pairwise;
pub mod robust;
mod series;
pub mod squint;
mod steps;
pub mod targets;
pub mod tracker;
mod wraps;

/// Smallest pivot of a factorisation, relative to the diagonal: a smaller one is rounding of some hundred terms.
pub(crate) const MIN_PIVOT: f64 = 1e-13;

pub use check::MotionError;
pub use increment::{Heading, Increment, chain, longest_chain};
pub use live::Live;
pub use model::{Array, Pose, Sighting, Target};
pub use pairwise::Pairwise;
pub use robust::Robust;
pub use tracker::{Residual, Step, Track, Tracker, track, track_numbered, track_with_headings};
