//! Array sizes of a frequency-domain former.

use super::axes::Axes;

/// Array sizes of a frequency-domain former.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Length of the slow-time transform: padded pulses, or the cells onto which uneven pulses are gridded.
    pub padded_pulses: usize,
    /// Number of retained along-track wavenumbers.
    pub along_wavenumbers: usize,
    /// Number of range bins.
    pub ranges: usize,
    /// Length of the inverse transform to along-track position.
    pub along_length: usize,
    /// Number of retained along-track positions.
    pub columns: usize,
}

impl Sizes {
    pub(super) fn of(axes: &Axes) -> Self {
        Self {
            padded_pulses: axes.slow_length,
            along_wavenumbers: axes.num_bins,
            ranges: axes.range.count,
            along_length: axes.along_length,
            columns: axes.along.count,
        }
    }
}
