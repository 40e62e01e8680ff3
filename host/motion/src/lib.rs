//! A radar's own motion, and the places of what it sees, from the phases of its echoes: MPGA, jointly over many pulses.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `motion`.
//!
//! Chim 2018, chapter 7, solves the motion from one pulse to the next by two least squares, of angles of arrival and of phase
//! differences, and adds up. Errors of the angles bias it, and all errors add up. Here the true path lengths are the model
//! ([`model`]), and poses of the radar and places of the targets are found together by least squares over all pulses
//! ([`joint`]): a target that is seen for a thousand pulses ties them all together. Each estimate comes with its covariance; on Gaussian noise,
//! which the model describes, that is the bound of Cramer and Rao ([`joint::covariances`]).
//!
//! **Frame.** A plane, whose origin is where the radar was first; it is turned such that the first target lies in the direction at which it
//! was seen first, by a heading of 0. What lies out of the plane is taken for farther away.
//!
//! **Phase.** Of an echo it falls by `2 pi / wavelength` a metre of path, as everywhere here.
#![forbid(unsafe_code)]

pub mod arrival;
mod check;
mod dense;
pub mod diagnosis;
pub mod increment;
pub mod joint;
pub mod model;
pub mod movers;
pub mod pairwise;
pub mod robust;
mod series;
pub mod squint;
pub mod tracker;

pub use check::MotionError;
pub use increment::{Heading, Increment, chain};
pub use model::{Array, Pose, Sighting, Target};
pub use pairwise::Pairwise;
pub use robust::Robust;
pub use tracker::{Step, Track, Tracker, track};
