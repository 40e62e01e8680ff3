//! The memory that a fixed-point engine works in.
//!
//! 4 bytes a cell of the map and a byte for 32 of them, 8 bytes a range bin and a pulse for work, 40
//! bytes a pulse for phases, a byte a frequency.

use num_complex::Complex;

use super::PulsePhase;
use crate::Sc16;
use crate::stream::{BlockFloat, Capacity};

/// The memory of a [`super::FixedEngine`]; longer is no harm. Functions give the lengths for a [`Capacity`].
#[derive(Debug)]
pub struct FixedSlices<'a> {
    /// Cells of the map, [`FixedSlices::cells_len`]: Doppler rows of frequencies, then of range bins.
    pub cells: &'a mut [Sc16],
    /// Exponents of the cells of a frequency, [`FixedSlices::column_exponents_len`].
    pub column_exponents: &'a mut [i8],
    /// Exponents of the finished rows' blocks, [`FixedSlices::row_exponents_len`].
    pub row_exponents: &'a mut [i8],
    /// A column or a row in 32 bits, [`FixedSlices::work_len`].
    pub work: &'a mut [Complex<i32>],
    /// Phases of the pulses, [`FixedSlices::pulses_len`].
    pub phases: &'a mut [PulsePhase],
    /// The pulses of a frequency, folded, [`FixedSlices::pulses_len`].
    pub folded: &'a mut [Complex<i32>],
}

impl FixedSlices<'_> {
    /// Cells of the map.
    pub const fn cells_len(capacity: &Capacity) -> usize {
        capacity.doppler_bins as usize * capacity.frequencies as usize
    }

    /// Exponents of columns.
    pub const fn column_exponents_len(capacity: &Capacity) -> usize {
        capacity.frequencies as usize
    }

    /// Exponents of rows. Enough for any patch of at most `doppler_bins` rows: rows of `W` bins, of
    /// which there are `n`, take `n ceil(W / 32) <= (n W + 31 n) / 32`, and `n W` is at most
    /// [`FixedSlices::cells_len`].
    pub const fn row_exponents_len(capacity: &Capacity) -> usize {
        let rounding = capacity.doppler_bins as usize * (BlockFloat::BLOCK - 1);
        (Self::cells_len(capacity) + rounding) / BlockFloat::BLOCK
    }

    /// A row of range bins, or a column of Doppler bins.
    pub const fn work_len(capacity: &Capacity) -> usize {
        if capacity.range_bins > capacity.doppler_bins {
            capacity.range_bins as usize
        } else {
            capacity.doppler_bins as usize
        }
    }

    /// Pulses.
    pub const fn pulses_len(capacity: &Capacity) -> usize {
        capacity.pulses as usize
    }
}
