//! A radar's motion from pulse to pulse, of its own echoes (MPGA), so that a module can send increments instead of pulses.
//!
//! ```text
//! samples of all channels ─> profile ─> search ─> echo ─> follow ─> pairwise ─> increment
//!                            power of    CFAR      range and  the same    two least
//!                            all channels          phases     target      squares
//! ```
//!
//! | | what it does | of Chim 2018 |
//! |---|---|---|
//! | [`Odometer`] | all of it, a bounded piece of work at a time, in a fixed set of buffers | 7.4 |
//! | [`Setup`], [`Follow`] | what it is told beforehand | 7.3.3 |
//! | [`Pairwise`] | the last part alone, of ranges and phases of named targets | (7.17) to (7.21) |
//!
//! **Input** of an odometer: every receiver's samples of every transmitter, a pulse at a time, phases `-2 pi f (path - reference path) / c`. **Output** a [`Step`] a pulse: the [`Increment`] since the
//! pulse before, in the array's frame there; `residual_m`, what the targets' paths differ by from it, and how many there were. **Memory** [`Odometer::BYTES`]. **Cost** a pulse: `C` transforms of `R`, and for each target 24 sums over `C F` samples; in float32 but for
//! what is done once a target. **Accuracy** (`tests/stream/odometer.rs`) phases to 1e-5 rad of those that the host finds in float64, increments to its increments of the same sightings; the same bits on every machine
//! (`selftest::OdometerSelfTest`). Errors: [`SetupError`], [`SampleError`].
//!
//! **Neglected**: what [`Pairwise`] neglects. Noise is taken for even over range where errors are told. More targets than there is room for, those out of range included, are left among the noise, the weakest first.

mod arrival;
mod echo;
mod follow;
mod odometer;
mod pairwise;
mod plane;
mod profile;
mod setup;
mod threshold;

pub use odometer::{Odometer, Progress, SampleError, Step};
pub use pairwise::{Antennas, Echo, Increment, MotionError, Moved, Pairwise};
pub use setup::{Follow, MOST_BRIDGED, MOST_TRAINING, Setup, SetupError};
