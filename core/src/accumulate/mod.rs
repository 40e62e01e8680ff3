//! Accumulation of maps: coherent into pixels, non-coherent into power.

mod centre;
mod coherent;
mod power;

use core::fmt;

pub use centre::{Centre, PixelGrid};
pub use coherent::{CoherentGrid, add_map};
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
        /// Shape of the maps before.
        expected: crate::Shape,
        /// Shape of this one.
        got: crate::Shape,
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
                got.num_doppler_bins,
                got.num_range_bins,
                expected.num_doppler_bins,
                expected.num_range_bins
            ),
        }
    }
}

impl core::error::Error for AccumulateError {}
