//! Numbers of a mantissa and an exponent: weights on the way in, blocks of 16 bits on the way out.
//!
//! Float32 is taken apart by its bits, so that a part without floating point is not asked for any.

use core::num::NonZeroU32;

use num_complex::Complex;

use crate::Sc16;

/// `mantissa 2^(exponent - 31)`, the mantissa's magnitude from `2^30` to below `2^31`, or zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Scaled {
    pub(super) mantissa: i32,
    pub(super) exponent: i32,
}

impl Scaled {
    pub(super) const ZERO: Self = Self {
        mantissa: 0,
        exponent: 0,
    };

    /// `magnitude 2^exponent`, cut to 31 bits.
    fn normal(magnitude: u64, exponent: i32, negative: bool) -> Self {
        let bits = u64::BITS - magnitude.leading_zeros();
        if bits == 0 {
            return Self::ZERO;
        }
        // 31 bits: below 2^31, so that the sign fits.
        let mantissa = match bits.checked_sub(31) {
            Some(surplus) => magnitude >> surplus,
            None => magnitude << (31 - bits),
        } as i32;
        Self {
            mantissa: if negative { -mantissa } else { mantissa },
            exponent: exponent + bits as i32,
        }
    }

    /// `value`, exact; nothing if it is not finite.
    pub(super) fn from_f32(value: f32) -> Option<Self> {
        let bits = value.to_bits();
        let (field, fraction) = ((bits >> 23) & 0xff, bits & 0x7f_ffff);
        let (magnitude, exponent) = match field {
            0xff => return None,
            0 => (fraction, -149),
            _ => (fraction | 0x80_0000, field as i32 - 150),
        };
        Some(Self::normal(magnitude.into(), exponent, bits >> 31 == 1))
    }

    /// `1 / value`, to `2^-30` of itself; powers of two exactly.
    pub(super) fn reciprocal(value: NonZeroU32) -> Self {
        Self::normal((1 << 62) / u64::from(value.get()), -62, false)
    }

    /// The product, to `2^-30` of itself.
    pub(super) fn times(self, other: Self) -> Self {
        let product = i64::from(self.mantissa) * i64::from(other.mantissa);
        let exponent = self.exponent + other.exponent - 62;
        Self::normal(product.unsigned_abs(), exponent, product < 0)
    }
}

/// The larger of `peak` and the magnitudes of both parts.
#[inline]
pub(super) fn peak(peak: u32, value: Complex<i32>) -> u32 {
    peak.max(value.re.unsigned_abs())
        .max(value.im.unsigned_abs())
}

/// How a block of 32-bit numbers becomes 16-bit mantissas of one exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Narrowing {
    /// Bits to drop, below 64.
    shift: u32,
    /// Bits by which an exponent above 127 is short; below 64, and 0 for sane weights.
    excess: u32,
    /// The block's exponent.
    pub(super) exponent: i8,
}

impl Narrowing {
    /// For parts up to `peak`, each worth `2^unit`; a mantissa counts `2^-15`.
    pub(super) fn new(peak: u32, unit: i32) -> Self {
        if peak == 0 {
            return Self {
                shift: 0,
                excess: 0,
                exponent: i8::MIN,
            };
        }
        let mut shift = (u32::BITS - peak.leading_zeros()).saturating_sub(15);
        // A peak that rounds up to 32768 needs one bit more.
        if rounded(peak.into(), shift) > i64::from(i16::MAX) {
            shift += 1;
        }
        let exponent = unit + 15 + shift as i32;
        let (lowest, highest) = (i32::from(i8::MIN), i32::from(i8::MAX));
        let below = (lowest - exponent).clamp(0, 31) as u32;
        let excess = (exponent - highest).clamp(0, 31) as u32;
        Self {
            shift: shift + below,
            excess,
            exponent: exponent.clamp(lowest, highest) as i8,
        }
    }

    /// The sample, rounded to nearest, and whether it had to be clamped: it never has, but for weights
    /// so large that the exponent does not fit.
    #[inline]
    pub(super) fn apply(self, value: Complex<i32>) -> (Sc16, bool) {
        let (re, re_clamped) = self.part(value.re);
        let (im, im_clamped) = self.part(value.im);
        (Sc16::from_bits(re, im), re_clamped || im_clamped)
    }

    #[inline]
    fn part(self, part: i32) -> (i16, bool) {
        if self.excess == 0 {
            // What the shift was chosen for: it fits. Halves up by a bit kept for it, in 32 bits; from
            // 32 bits on only the sign is left, and rounds to zero.
            let last = self.shift.min(1);
            let kept = part >> self.shift.wrapping_sub(last).min(31);
            return ((kept.wrapping_add(last as i32) >> last) as i16, false);
        }
        let exact = rounded(part.into(), self.shift) << self.excess;
        let clamped = exact.clamp(i16::MIN.into(), i16::MAX.into());
        (clamped as i16, clamped != exact)
    }
}

/// `value 2^-shift` to nearest, halves up; `shift` below 63.
#[inline]
fn rounded(value: i64, shift: u32) -> i64 {
    (value + ((1 << shift) >> 1)) >> shift
}
