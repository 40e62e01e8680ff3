//! Radar motion estimated from its own echoes (MPGA), so that a module can send increments instead of pulses.
//!
//! ```text
//! samples of all channels ─> profile ─> search ─> echo ─> follow ─> pairwise ─> increment
//!                            noncoherent    CFAR      range and  tracker  two least
//!                            integration              phases              squares
//! ```
//!
//! | | function | in Chim 2018 |
//! |---|---|---|
//! | [`Odometer`] | the whole chain, in steps of bounded duration and fixed buffers | 7.4 |
//! | [`Setup`], [`TrackerSettings`] | its settings | 7.3.3 |
//! | [`Pairwise`] | the last stage alone, from ranges and phases of identified targets | (7.17) to (7.21) |
//!
//! **Input** of an odometer: the samples of every receiver for every transmitter, one pulse at a time, with phases
//! `-2 pi f (path - reference path) / c`. **Output**: one [`Step`] per pulse, with the [`Increment`] since the previous
//! pulse in the array frame at that pulse, the RMS residual `residual_m` of the target paths, and the number of targets.
//! **Memory**: [`Odometer::BYTES`]. **Cost** per pulse: `C` transforms of `R` points, and per target 24 sums over `C F`
//! samples; float32 except for the final steps per target. **Accuracy** (`tests/stream/odometer.rs`): phases within
//! 1e-5 rad of the host's in float64, increments equal to the host's for the same sightings; bit-identical on every machine
//! (`selftest::OdometerSelfTest`). **Errors**: [`SetupError`], [`SampleError`].
//!
//! **Neglected**: what [`Pairwise`] neglects. Error estimates assume noise uniform over range. Targets beyond the
//! capacity, those outside the range limits included, remain in the noise, the weakest first.

mod arrival;
mod echo;
mod factor;
mod follow;
mod odometer;
mod pairwise;
mod plane;
mod profile;
mod setup;
pub mod threshold;

pub use odometer::{Odometer, Progress, SampleError, Step};
pub use pairwise::{Antennas, Echo, Increment, MotionError, MotionEstimate, Pairwise};
pub use setup::{MAX_BRIDGED, MAX_TRAINING, Setup, SetupError, TrackerSettings};
