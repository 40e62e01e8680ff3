//! The inner loops of image formation: what is done for every sample or every pixel, on slices of plain numbers.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation. Its image formers plan, read and share out
//! the work; their time goes by here.
//!
//! - [`paths`]: from a pulse's antennas to many points.
//! - [`backprojection`]: a pulse's range profile added to many pixels.
//! - [`compensation`]: the samples of a pulse referred to another path.
//! - [`decimation`]: one sample of several, one pulse of several.
//! - [`spreading`]: samples from anywhere put onto a raster.
//! - [`reading`]: rasters and range-Doppler maps read between their elements.
//!
//! A kernel knows no grid, no recording and no former, holds nothing from call to call and runs on the caller's thread. Its
//! result is the same bits however its caller divides points, pixels or rows among calls. Positions and phases are float64,
//! samples and sums complex float32 unless a kernel says otherwise; lengths that do not fit each other panic.
//!
//! Each is held in its own tests to the sum that defines it, written out anew in float64, within an error that is derived there.
//!
//! This is the one crate of the library in which SIMD, and so `unsafe`, will ever be allowed: beside the portable loop, and
//! held to the same tests. As yet there is none.
#![forbid(unsafe_code)]

pub mod backprojection;
pub mod compensation;
pub mod decimation;
pub mod paths;
pub mod reading;
pub mod spreading;
#[cfg(test)]
mod trial;
