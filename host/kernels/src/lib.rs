//! The inner loops of image formation: what is done for every sample or every pixel, on slices of plain numbers.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation. Its image formers plan, read and share out
//! the work; their time goes by here.
//!
//! - [`paths`]: from a pulse's antennas to many points.
//! - [`tile`]: the range profiles of some pulses added to the pixels of a small raster, or of one to points wherever they are.
//! - [`blurred`]: those of a pulse whose samples were taken one after another in motion.
//! - [`lanes`]: the instructions that this is done in.
//! - [`horner`]: the samples of a pulse summed at many delays.
//! - [`power`]: their squares summed.
//! - [`compensation`]: the samples of a pulse referred to another path.
//! - [`doppler`]: slow time to Doppler where the axis scales with frequency.
//! - [`halving`]: half as many pulses, half as many samples.
//! - [`spreading`]: samples from anywhere put onto a raster.
//! - [`reading`]: rasters read between their elements.
//! - [`map`]: range-Doppler maps read where points have their paths and rates.
//! - [`ceiling`]: products and sums alone, by which the others are measured.
//!
//! A kernel knows no grid, no recording and no former, holds nothing from call to call and runs on the caller's thread. Its
//! result is the same bits however its caller divides points, pixels or rows among calls. Positions and phases are float64,
//! samples and sums complex float32 unless a kernel says otherwise; lengths that do not fit each other panic.
//!
//! Each is held in its own tests to the sum that defines it, written out anew in float64, within an error that is derived there.
//!
//! This is the one crate of the library in which SIMD, and so `unsafe`, is allowed: in [`lanes`], beside the portable form, which
//! gives the same bits.
#![deny(unsafe_code)]

pub mod blurred;
pub mod ceiling;
pub mod compensation;
pub mod doppler;
pub mod halving;
pub mod horner;
#[allow(unsafe_code)]
pub mod lanes;
pub mod map;
pub mod paths;
mod phasor;
pub mod power;
pub mod reading;
pub mod spreading;
mod taps;
pub mod tile;
#[cfg(test)]
mod trial;
