//! Accumulation of maps: coherent into pixels, non-coherent into power.
//!
//! Whole maps ([`crate::Map`]) and, with the feature `stream`, maps of patches (its `PatchMap`) add up in
//! the same owners: [`CoherentGrid`] and [`PowerMap`].

mod centre;
#[cfg(feature = "stream")]
mod chip;
mod coherent;
#[cfg(feature = "stream")]
mod kernel;
#[cfg(feature = "stream")]
mod patch_power;
mod power;

use core::fmt;

pub use centre::{Centre, PixelGrid};
#[cfg(feature = "stream")]
pub use chip::add_patch_map;
pub use coherent::{CoherentGrid, add_map};
#[cfg(feature = "stream")]
pub use kernel::Kernel;
pub use power::{PowerMap, add_power};

/// Why an accumulator could not be set up or fed. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccumulateError {
    /// More elements than the accumulator was built for.
    Capacity {
        /// Elements it holds.
        capacity: usize,
        /// Elements wanted; `usize::MAX` if they cannot even be counted.
        wanted: usize,
    },
    /// Maps of one accumulation must have one shape.
    Shape {
        /// Doppler and range bins of the maps before.
        expected: [usize; 2],
        /// Those of this one.
        got: [usize; 2],
    },
}

impl fmt::Display for AccumulateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capacity { capacity, wanted } => {
                write!(
                    f,
                    "{wanted} elements do not fit an accumulator of {capacity}"
                )
            }
            Self::Shape { expected, got } => write!(
                f,
                "a map of {} Doppler x {} range bins cannot be added to maps of {} x {}",
                got[0], got[1], expected[0], expected[1]
            ),
        }
    }
}

impl core::error::Error for AccumulateError {}
