//! 16-bit samples in blocks of a common exponent: what the fixed-point path makes maps of.

use num_complex::Complex32;

use crate::Sc16;

/// 16-bit samples in blocks of a common exponent: sample `i` of a row is
/// `mantissas[i] 2^exponents[i / BLOCK]`, `mantissas` in `[-1, 1)`. Every row begins a new block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockFloat<'a> {
    /// Row by row.
    pub mantissas: &'a [Sc16],
    /// Row by row, [`BlockFloat::blocks`] each.
    pub exponents: &'a [i8],
}

impl BlockFloat<'_> {
    /// Samples that share an exponent.
    pub const BLOCK: usize = 32;

    /// Exponents of a row of `len` samples.
    pub const fn blocks(len: usize) -> usize {
        len.div_ceil(Self::BLOCK)
    }

    /// As [`super::MapSamples::at`].
    #[inline]
    pub(super) fn at(&self, width: usize, row: usize, column: usize) -> Option<Complex32> {
        let mantissa = self.mantissas.get(row * width + column)?;
        let place = row * Self::blocks(width) + column / Self::BLOCK;
        let exponent = self.exponents.get(place)?;
        Some(mantissa.to_complex32() * power_of_two(*exponent))
    }

    /// As [`super::MapSamples::weighted`].
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

/// `2^exponent`, exact.
pub fn power_of_two(exponent: i8) -> f32 {
    // Within the normal numbers for exponents above -127; -127 and -128 are denormal and exact too.
    let biased = i32::from(exponent) + 127;
    if biased > 0 {
        f32::from_bits((biased as u32) << 23)
    } else {
        f32::from_bits(1 << (22 + biased))
    }
}
