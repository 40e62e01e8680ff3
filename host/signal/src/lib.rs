//! Windows, transforms, kernels, and small systems of linear equations.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `signal`.
#![forbid(unsafe_code)]

pub mod dense;
pub mod fast_length;
pub mod halfway;
pub mod kaiser_bessel;
pub mod phase;
pub mod range_profile;
pub mod scaled_dft;
pub mod sinc_keystone;
mod taps;
pub mod window;
pub mod windowed_sinc;
