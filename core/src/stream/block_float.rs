//! Block floating point: 16-bit mantissas with one exponent per block, the map format of the fixed-point path.

use num_complex::Complex32;

use crate::Sc16;

/// Block floating-point samples: sample `i` of a row is `mantissas[i] 2^exponents[i / BLOCK]` with
/// `mantissas` in `[-1, 1)` (Q15). Every row begins a new block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockFloat<'a> {
    /// Mantissas in row-major order.
    pub mantissas: &'a [Sc16],
    /// Exponents in row-major order, [`BlockFloat::blocks`] per row.
    pub exponents: &'a [i8],
}

impl BlockFloat<'_> {
    /// Number of samples that share one exponent.
    pub const BLOCK: usize = 32;

    /// Number of exponents of a row of `len` samples.
    pub const fn blocks(len: usize) -> usize {
        len.div_ceil(Self::BLOCK)
    }

    /// Sample at `row`, `column`; see [`super::MapSamples::at`].
    #[inline]
    pub(super) fn at(&self, width: usize, row: usize, column: usize) -> Option<Complex32> {
        let mantissa = self.mantissas.get(row * width + column)?;
        let place = row * Self::blocks(width) + column / Self::BLOCK;
        let exponent = self.exponents.get(place)?;
        Some(mantissa.to_complex32() * power_of_two(*exponent))
    }

    /// Weighted sum of consecutive samples; see [`super::MapSamples::weighted`].
    #[inline]
    pub(super) fn weighted<const TAPS: usize>(
        &self,
        width: usize,
        row: usize,
        first: usize,
        weights: &[f32; TAPS],
    ) -> Option<Complex32> {
        let mantissas = self.mantissas.get(row * width + first..)?;
        let mantissas = mantissas.first_chunk::<TAPS>()?;
        let exponents = self.exponents.get(row * Self::blocks(width)..)?;
        let mut sum = Complex32::ZERO;
        for ((column, mantissa), weight) in (first..).zip(mantissas).zip(weights) {
            let scale = power_of_two(*exponents.get(column / Self::BLOCK)?);
            sum += mantissa.to_complex32() * (scale * *weight);
        }
        Some(sum)
    }
}

/// Exact power of two, `2^exponent`.
pub fn power_of_two(exponent: i8) -> f32 {
    // Normal numbers for exponents above -127; -127 and -128 are subnormal and still exact.
    let biased = i32::from(exponent) + 127;
    if biased > 0 {
        f32::from_bits((biased as u32) << 23)
    } else {
        f32::from_bits(1 << (22 + biased))
    }
}
