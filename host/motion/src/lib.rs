//! A radar's own motion, and the places of what it sees, from the phases of its echoes (MPGA).
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `motion`.
//!
//! | | how | drifts | for |
//! |---|---|---|---|
//! | (a) [`pairwise`] | from one pulse to the next by two least squares, as Chim 2018, chapter 7 | yes; too short where angles err | what a module can compute: the core has it too |
//! | (b) [`robust`] | the same by true path lengths, unbiased, without what does not belong | yes | increments with covariance, of scenes that change |
//! | (c) [`tracker`], [`joint`] | poses and places together over all pulses | least | tracks: to the bound of Cramer and Rao |
//!
//! Root mean square error of the distance from the first pose to the last, in times that bound: 77 GHz, a metre in 1000 pulses, 4 reflectors at 2 to 5 m, receivers half a wavelength apart, 50 seeds
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
//! What is wrong with what is seen is told beforehand by [`diagnosis`]; which targets move, and how fast, by [`movers`], pulse by pulse by [`live`]; how the array is mounted, where that can be told, by [`squint`].
//!
//! **Frame.** A plane, whose origin is where the radar was first; it is turned such that the first target lies in the direction at which it
//! was seen first, by a heading of 0. What lies out of the plane is taken for farther away.
//!
//! **Phase.** Of an echo it falls by `2 pi / wavelength` a metre of path, as everywhere here.
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
pub mod tracker;

/// A pivot that is less of what stood there is none: of some hundred unknowns some hundred roundings are left.
pub(crate) const LEAST_PIVOT: f64 = 1e-13;

pub use check::MotionError;
pub use increment::{Heading, Increment, chain};
pub use live::Live;
pub use model::{Array, Pose, Sighting, Target};
pub use pairwise::Pairwise;
pub use robust::Robust;
pub use tracker::{Step, Track, Tracker, track, track_turned};
