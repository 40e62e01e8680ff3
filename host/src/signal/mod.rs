//! Windows, transforms and kernels.

pub mod fast_length;
pub mod phase;
pub mod range_profile;
pub mod window;
