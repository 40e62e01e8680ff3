//! Signal processing: window functions, interpolation kernels, range profiles, Keystone and Doppler transforms, and
//! small systems of linear equations.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; module `signal` of the crate
//! `subaperture`.
#![forbid(unsafe_code)]

pub mod decimation_kernel;
pub mod dense;
pub mod fast_length;
pub mod flat_kernel;
pub mod kaiser_bessel;
pub mod phase;
pub mod polynomial;
pub mod range_profile;
pub mod scaled_dft;
pub mod sinc_keystone;
mod taps;
pub mod window;
pub mod windowed_sinc;
