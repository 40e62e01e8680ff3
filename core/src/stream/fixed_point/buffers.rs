//! Buffers of the fixed-point engine.
//!
//! Memory: 4 bytes per map cell and 1 byte per 32 cells; 8 bytes per range bin and per pulse of work memory;
//! 40 bytes per pulse for phases; 1 byte per frequency.

use num_complex::Complex;

use super::PulsePhase;
use crate::stream::{BlockFloat, Capacity};
use crate::{LengthError, Sc16};

/// Buffers of a [`super::FixedEngine`]. The functions state the minimum lengths for a [`Capacity`].
#[derive(Debug)]
pub struct FixedSlices<'a> {
    /// Map cells, [`FixedSlices::cells_len`]: Doppler rows of frequencies, later of range bins.
    pub cells: &'a mut [Sc16],
    /// Exponent of each frequency column, [`FixedSlices::column_exponents_len`].
    pub column_exponents: &'a mut [i8],
    /// Block exponents of the finished rows, [`FixedSlices::row_exponents_len`].
    pub row_exponents: &'a mut [i8],
    /// 32-bit work buffer for one column or row, [`FixedSlices::work_len`].
    pub work: &'a mut [Complex<i32>],
    /// Compensation phases of the pulses, [`FixedSlices::pulses_len`].
    pub phases: &'a mut [PulsePhase],
    /// Folded pulses of one frequency, [`FixedSlices::pulses_len`].
    pub folded: &'a mut [Complex<i32>],
}

impl FixedSlices<'_> {
    /// Check that every buffer is long enough for `capacity`.
    pub(super) fn check(&self, capacity: &Capacity) -> Result<(), LengthError> {
        let pulses = Self::pulses_len(capacity);
        let columns = Self::column_exponents_len(capacity);
        let rows = Self::row_exponents_len(capacity);
        LengthError::at_least("cells", Self::cells_len(capacity), self.cells.len())?;
        LengthError::at_least("column exponents", columns, self.column_exponents.len())?;
        LengthError::at_least("row exponents", rows, self.row_exponents.len())?;
        LengthError::at_least("work", Self::work_len(capacity), self.work.len())?;
        LengthError::at_least("pulse phases", pulses, self.phases.len())?;
        LengthError::at_least("folded pulses", pulses, self.folded.len())
    }

    /// Minimum number of map cells.
    pub const fn cells_len(capacity: &Capacity) -> usize {
        capacity.doppler_bins as usize * capacity.frequencies as usize
    }

    /// Minimum number of column exponents.
    pub const fn column_exponents_len(capacity: &Capacity) -> usize {
        capacity.frequencies as usize
    }

    /// Minimum number of row exponents. Sufficient for any patch of at most `doppler_bins` rows: `n` rows of `W`
    /// bins need `n ceil(W / 32) <= (n W + 31 n) / 32`, and `n W` is at most [`FixedSlices::cells_len`].
    pub const fn row_exponents_len(capacity: &Capacity) -> usize {
        let rounding = capacity.doppler_bins as usize * (BlockFloat::BLOCK - 1);
        (Self::cells_len(capacity) + rounding) / BlockFloat::BLOCK
    }

    /// Minimum length of the work buffer: one row of range bins or one column of Doppler bins.
    pub const fn work_len(capacity: &Capacity) -> usize {
        if capacity.range_bins > capacity.doppler_bins {
            capacity.range_bins as usize
        } else {
            capacity.doppler_bins as usize
        }
    }

    /// Minimum number of pulse phases and of folded pulses.
    pub const fn pulses_len(capacity: &Capacity) -> usize {
        capacity.pulses as usize
    }
}
