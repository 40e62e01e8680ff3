//! Host side of the embedded module: planning, serial link, received maps and their image.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), a library for radar image formation. The crate `subaperture` re-exports
//! it as `module`.
//!
//! ```text
//! phase history ─> plan ─> link ═ serial ═ module        (subaperture-core: stream)
//!                           └─> maps, maps_file ─> image
//! ```
//!
//! The module is the embedded processor on the platform that runs `subaperture-core`.
//!
//! - [`plan`]: sub-CPIs, patches and buffers that keep an error bound within a module's memory;
//! - [`link`]: sessions with a module over a serial line, or under emulation;
//! - [`accumulated`]: image that a module accumulates on board;
//! - [`detections`]: positions of targets that a module detects;
//! - [`maps`]: range-Doppler maps of patches; [`maps_file`]: their file format; [`image`]: the image formed from them;
//! - [`crosscheck`]: comparison of the core's and the host's `rdbp` maps with a float64 sum, for every sub-CPI;
//! - [`range_doppler`]: range-Doppler map of a sub-CPI for display;
//! - [`selftest`]: products of built-in recordings from a module, compared with this computer's.
#![forbid(unsafe_code)]

pub mod accumulated;
pub mod crosscheck;
pub mod detections;
pub mod image;
pub mod link;
pub mod maps;
pub mod maps_file;
pub mod plan;
pub mod range_doppler;
pub mod selftest;
