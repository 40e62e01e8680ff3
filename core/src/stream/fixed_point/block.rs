//! Mantissa-exponent numbers: window weights on input, 16-bit blocks on output.
//!
//! Float32 values are decomposed by their bits, so no floating-point operation is needed.

use core::num::NonZeroU32;

use num_complex::Complex;

use crate::Sc16;

/// `mantissa 2^(exponent - 31)`, normalised: `2^30 <= |mantissa| < 2^31`, or zero.
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

    /// Normalise `magnitude 2^exponent`, truncated to 31 bits.
    fn normal(magnitude: u64, exponent: i32, negative: bool) -> Self {
        let bits = u64::BITS - magnitude.leading_zeros();
        if bits == 0 {
            return Self::ZERO;
        }
        // 31 bits, below 2^31, leave room for the sign.
        let mantissa = match bits.checked_sub(31) {
            Some(surplus) => magnitude >> surplus,
            None => magnitude << (31 - bits),
        } as i32;
        Self {
            mantissa: if negative { -mantissa } else { mantissa },
            exponent: exponent + bits as i32,
        }
    }

    /// Exact conversion. `None` if `value` is not finite.
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

    /// `1 / value`, with relative error below `2^-30`; exact for powers of two.
    pub(super) fn reciprocal(value: NonZeroU32) -> Self {
        Self::normal((1 << 62) / u64::from(value.get()), -62, false)
    }

    /// Product, with relative error below `2^-30`.
    pub(super) fn times(self, other: Self) -> Self {
        let product = i64::from(self.mantissa) * i64::from(other.mantissa);
        let exponent = self.exponent + other.exponent - 62;
        Self::normal(product.unsigned_abs(), exponent, product < 0)
    }
}

/// Maximum of `peak` and the magnitudes of both parts.
#[inline]
pub(super) fn peak(peak: u32, value: Complex<i32>) -> u32 {
    peak.max(value.re.unsigned_abs())
        .max(value.im.unsigned_abs())
}

/// Conversion of a block of 32-bit integers to 16-bit mantissas with one exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Narrowing {
    /// Right shift in bits, below 64.
    shift: u32,
    /// Left shift for an exponent above 127, below 64. 0 for any practical window.
    excess: u32,
    /// Exponent of the block.
    pub(super) exponent: i8,
}

impl Narrowing {
    /// Choose the shift for parts up to `peak` in units of `2^unit`; a mantissa unit is `2^-15`.
    pub(super) fn new(peak: u32, unit: i32) -> Self {
        if peak == 0 {
            return Self {
                shift: 0,
                excess: 0,
                exponent: i8::MIN,
            };
        }
        let mut shift = (u32::BITS - peak.leading_zeros()).saturating_sub(15);
        // A peak that rounds up to 32768 needs one more bit.
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

    /// Round a sample to nearest. The flag is true if it was clamped, which happens only if weights are so large
    /// that the exponent does not fit.
    #[inline]
    pub(super) fn apply(self, value: Complex<i32>) -> (Sc16, bool) {
        let (re, re_clamped) = self.part(value.re);
        let (im, im_clamped) = self.part(value.im);
        (Sc16::from_bits(re, im), re_clamped || im_clamped)
    }

    #[inline]
    fn part(self, part: i32) -> (i16, bool) {
        if self.excess == 0 {
            // The shift was chosen so that the result fits. One extra bit is kept to round halves up within 32 bits.
            // Shifts of 32 bits or more leave only the sign, which rounds to zero.
            let last = self.shift.min(1);
            let kept = part >> self.shift.wrapping_sub(last).min(31);
            return ((kept.wrapping_add(last as i32) >> last) as i16, false);
        }
        let exact = rounded(part.into(), self.shift) << self.excess;
        let clamped = exact.clamp(i16::MIN.into(), i16::MAX.into());
        (clamped as i16, clamped != exact)
    }
}

/// `value 2^-shift` rounded to nearest, halves up; `shift` below 63.
#[inline]
fn rounded(value: i64, shift: u32) -> i64 {
    (value + ((1 << shift) >> 1)) >> shift
}
