//! Samples of a map, in the form of either arithmetic, and how they are read.
//!
//! Here alone the core asks which of the two forms samples have; everybody else reads through this.

use num_complex::Complex32;

#[cfg(feature = "fixed")]
use super::BlockFloat;

/// Samples of a map, Doppler bin by Doppler bin (ascending), range bins (ascending) contiguous.
///
/// Without the feature `fixed` there is no second form, but code must be written as if there might be
/// one: another crate of the same program may ask for it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(not(feature = "fixed"), non_exhaustive)]
pub enum MapSamples<'a> {
    /// By the floating-point path.
    Float(&'a [Complex32]),
    /// By the fixed-point path, in blocks of a common exponent.
    #[cfg(feature = "fixed")]
    Fixed(BlockFloat<'a>),
}

impl MapSamples<'_> {
    /// The sample in `column` of `row`, of rows of `width`.
    #[inline]
    pub(super) fn at(&self, width: usize, row: usize, column: usize) -> Option<Complex32> {
        match self {
            Self::Float(samples) => samples.get(row * width + column).copied(),
            #[cfg(feature = "fixed")]
            Self::Fixed(block_float) => block_float.at(width, row, column),
        }
    }

    /// Weighted sum of the samples from `first` on of `row`, of rows of `width`; the row must have them all.
    #[inline]
    pub(crate) fn weighted<const TAPS: usize>(
        &self,
        width: usize,
        row: usize,
        first: usize,
        weights: &[f32; TAPS],
    ) -> Option<Complex32> {
        match self {
            Self::Float(samples) => {
                let samples = samples.get(row * width + first..)?.first_chunk::<TAPS>()?;
                let mut sum = Complex32::ZERO;
                for (sample, weight) in samples.iter().zip(weights) {
                    sum += *sample * *weight;
                }
                Some(sum)
            }
            #[cfg(feature = "fixed")]
            Self::Fixed(block_float) => block_float.weighted(width, row, first, weights),
        }
    }
}
