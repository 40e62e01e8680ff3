//! Windows, transforms and kernels.
pub mod window;
