//! Accumulation of maps: coherent into image pixels, noncoherent into power.
//!
//! [`CoherentGrid`] and [`PowerMap`] accept whole maps ([`crate::Map`]) and, with the feature `stream`, patch maps
//! (`PatchMap`).

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
pub use chip::{ChipKernel, add_patch_map};
pub use coherent::{CoherentGrid, add_map};
#[cfg(feature = "stream")]
pub use kernel::Kernel;
pub use power::{PowerMap, add_power};

/// Reason why an accumulator could not be set up or rejected a map. It is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AccumulateError {
    /// More elements than the accumulator's capacity.
    Capacity {
        /// Capacity in elements.
        capacity: usize,
        /// Requested elements; `usize::MAX` if their number overflows.
        wanted: usize,
    },
    /// The map differs in shape from the maps already added.
    Shape {
        /// Doppler and range bins of the maps added before.
        expected: [usize; 2],
        /// Doppler and range bins of the rejected map.
        got: [usize; 2],
    },
}

impl fmt::Display for AccumulateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capacity { capacity, wanted } => {
                write!(
                    f,
                    "accumulator capacity: expected at most {capacity} elements, found {wanted}"
                )
            }
            Self::Shape { expected, got } => write!(
                f,
                "map shape: expected {2} Doppler x {3} range bins like the maps before, found {0} x {1}",
                got[0], got[1], expected[0], expected[1]
            ),
        }
    }
}

impl core::error::Error for AccumulateError {}
