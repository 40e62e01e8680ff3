//! Inner loops of image formation, on slices of numbers.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation. Image formers plan, read and distribute
//! the work; the processing time is spent in these kernels.
//!
//! - [`paths`]: path lengths from a pulse's antennas to many points.
//! - [`tile`]: backprojection of pulses onto a tile of pixels, or onto arbitrary points.
//! - [`range_migration_blur`]: backprojection of a pulse smeared by intra-pulse motion.
//! - [`lanes`]: SIMD lanes and instruction sets.
//! - [`horner`]: sum of a pulse's samples at many delays, in float64.
//! - [`folded_sums`]: sum of a pulse's samples at many delays, in float32.
//! - [`phasor`]: phasors of many phases.
//! - [`power`]: power of a pulse, and statistics of powers.
//! - [`compensation`]: compensation of a pulse to another reference path.
//! - [`doppler`]: Keystone Doppler transform (axis scaled with frequency).
//! - [`decimation`]: decimation by two in slow time and frequency.
//! - [`gridding`]: gridding (adjoint NUFFT) of samples onto a raster.
//! - [`reading`]: interpolation of rasters.
//! - [`map`]: interpolation of range-Doppler maps at the path and rate of points.
//! - [`patch_map`]: range-Doppler map of a patch by gridding, and its image by separable interpolation.
//! - [`rank_two`]: rank-2 model of the paths to the points of a patch.
//! - [`column_fft`]: Fourier transforms of many columns at once.
//! - [`ceiling`]: peak multiply-add rate, for comparison.
//!
//! A kernel is independent of grids, recordings and formers, keeps no state between calls and runs on the caller's thread. Its
//! result is bit-identical for any division of points, pixels or rows among calls. Positions and phases are float64,
//! samples and sums complex float32 unless stated otherwise; inconsistent lengths panic.
//!
//! The tests compare each kernel with its defining sum, evaluated independently in float64, within a derived error bound.
//!
//! This is the only crate of the library with SIMD and therefore `unsafe` code, in [`lanes`]; the portable form there
//! gives identical bits.
#![deny(unsafe_code)]

pub mod ceiling;
pub mod column_fft;
pub mod compensation;
pub mod decimation;
pub mod doppler;
pub mod folded_sums;
pub mod gridding;
pub mod horner;
#[allow(unsafe_code)]
pub mod lanes;
pub mod map;
pub mod patch_map;
pub mod paths;
pub mod phasor;
pub mod power;
pub mod range_migration_blur;
pub mod rank_two;
pub mod reading;
mod taps;
pub mod tile;
#[cfg(test)]
mod trial;
