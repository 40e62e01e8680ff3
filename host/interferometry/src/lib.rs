//! Coherent SAR images: registration, interferogram, coherence and its statistics, coherent change detection (CCD), displacement over repeat passes.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture`
//! re-exports it as the module `interferometry`.
//!
//! ```text
//! image, reference (on one grid)
//!   ─> registration: residual offset ─> refused, corrected or within tolerance
//!   ─> Interferogram: complex coherence in a sliding window
//!   ─> Autocorrelation: effective number of independent looks of the window
//!   ─> CoherenceDistribution: threshold for the false-alarm probability ─> ChangeMap
//! ```
//!
//! [`detect_changes`] does the last three steps; [`displacement`] measures the displacement of points over many passes. Both images must be complex and on the same pixels; `subaperture::images::Pair` relates images on different grids.
//!
//! **Signs.** The interferogram is `image conj(reference)`. In images formed by backprojection, a scatterer at `s` seen at the pixel `p` has the phase
//! `(2 pi / lambda) (path(p) - path(s))`, so that the interferometric phase is
//!
//! ```text
//! phi = (2 pi / lambda) [ (path_image(p) - path_image(s)) - (path_reference(p) - path_reference(s)) ]
//! ```
//!
//! with two-way paths. A scatterer that recedes by `d` along the line of sight after the reference pass has `phi = -4 pi d / lambda`.
//! The phase of the focusing surface is 0 (flattened by focusing); a height above it gives the topographic phase of the perpendicular baseline.
//!
//! **Sources.** Touzi, Lopes, Bruniquel, Vachon, "Coherence estimation for SAR imagery", IEEE Trans. Geosci. Remote Sens. 37(1), 1999 (distribution and bias);
//! Bamler, Hartl, "Synthetic aperture radar interferometry", Inverse Problems 14, 1998; Jakowatz et al., "Spotlight-mode synthetic aperture radar", 1996, section 5.6 (CCD).
#![forbid(unsafe_code)]

mod change;
pub mod displacement;
mod error;
mod interferogram;
mod looks;
mod negative_binomial;
pub mod registration;
mod statistics;

pub use change::{ChangeMap, PixelCounts, Settings, detect_changes};
pub use error::InterferometryError;
pub use interferogram::{Interferogram, interferogram};
pub use looks::Autocorrelation;
pub use statistics::{CoherenceDistribution, MAX_COHERENCE, MAX_LOOKS, coherence_of_median};
