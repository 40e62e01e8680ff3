//! Map samples in float32 or block floating point, and access to them.
//!
//! This is the only place in the core that distinguishes the two formats.

use num_complex::Complex32;

#[cfg(feature = "fixed")]
use super::BlockFloat;

/// Samples of a map, `[Doppler bin][range bin]`, both axes ascending, range contiguous.
///
/// Without the feature `fixed` only `Float` exists. The enum is then `non_exhaustive`, because another crate of
/// the same program can enable the feature.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(not(feature = "fixed"), non_exhaustive)]
pub enum MapSamples<'a> {
    /// Complex float32 samples of the floating-point path.
    Float(&'a [Complex32]),
    /// Block floating-point samples of the fixed-point path.
    #[cfg(feature = "fixed")]
    Fixed(BlockFloat<'a>),
}

impl MapSamples<'_> {
    /// Sample at `row`, `column` of a map whose rows have `width` samples. `None` outside the map.
    #[inline]
    pub(super) fn at(&self, width: usize, row: usize, column: usize) -> Option<Complex32> {
        match self {
            Self::Float(samples) => samples.get(row * width + column).copied(),
            #[cfg(feature = "fixed")]
            Self::Fixed(block_float) => block_float.at(width, row, column),
        }
    }

    /// Weighted sum of `TAPS` consecutive samples of `row` from column `first`. The row must contain all of them.
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
