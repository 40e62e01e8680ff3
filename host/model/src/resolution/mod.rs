//! Spectral support, resolution and sampling of SAR collections.
//!
//! - [`slant`]: slant plane (range and cross-range);
//! - [`support`]: spatial frequencies sampled by the pulses, their projection on a line, and the impulse response along it;
//! - [`theory`]: theoretical width and sidelobes of an impulse response;
//! - [`survey`]: aperture, resolution, sampling and default grid of a collection.

pub mod slant;
pub mod support;
pub mod survey;
pub mod theory;
