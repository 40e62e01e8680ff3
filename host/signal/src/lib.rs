//! Windows, transforms and kernels.
#![forbid(unsafe_code)]

pub mod fast_length;
pub mod kaiser_bessel;
pub mod phase;
pub mod range_profile;
pub mod scaled_dft;
pub mod sinc_keystone;
mod taps;
pub mod window;
pub mod windowed_sinc;
