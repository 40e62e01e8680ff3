//! 16-bit complex samples (Q15), the output format of A/D converters.

use fixed::types::I1F15;
use num_complex::Complex32;

use crate::stream::{Sample, Sealed};

/// Complex sample with 16-bit parts in `[-1, 1)` (Q15), the `sc16` format of converters and radios.
///
/// ```
/// use subaperture_core::{Complex32, Sc16};
/// let sample = Sc16::from_bits(16384, -32768);
/// assert_eq!(sample.to_complex32(), Complex32::new(0.5, -1.0));
/// // Out of range: clamps to the nearest sample and returns true.
/// assert_eq!(Sc16::from_complex32(Complex32::new(1.0, 0.0)), (Sc16::from_bits(32767, 0), true));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sc16 {
    /// Real part.
    pub re: I1F15,
    /// Imaginary part.
    pub im: I1F15,
}

impl Sc16 {
    /// Zero sample.
    pub const ZERO: Self = Self::from_bits(0, 0);

    /// Create a sample from integers in units of `2^-15`.
    pub const fn from_bits(re: i16, im: i16) -> Self {
        Self {
            re: I1F15::from_bits(re),
            im: I1F15::from_bits(im),
        }
    }

    /// Convert to float32. Exact.
    pub fn to_complex32(self) -> Complex32 {
        const UNIT: f32 = 1.0 / 32768.0;
        Complex32::new(
            f32::from(self.re.to_bits()) * UNIT,
            f32::from(self.im.to_bits()) * UNIT,
        )
    }

    /// Round to the nearest sample, halves away from zero. The flag is true if a part was out of range and was
    /// clamped, or was NaN and became zero.
    pub fn from_complex32(value: Complex32) -> (Self, bool) {
        let (re, clamped_re) = nearest(value.re);
        let (im, clamped_im) = nearest(value.im);
        (Self::from_bits(re, im), clamped_re || clamped_im)
    }

    /// Whether a part is at a limit of its range, where a converter clips.
    pub fn at_limit(self) -> bool {
        let limit = |part: I1F15| part == I1F15::MAX || part == I1F15::MIN;
        limit(self.re) || limit(self.im)
    }
}

impl Sealed for Sc16 {}

impl Sample for Sc16 {
    const ZERO: Self = Self::ZERO;

    fn is_finite(self) -> bool {
        true
    }

    fn at_limit(self) -> bool {
        Self::at_limit(self)
    }
}

/// `value` in units of `2^-15`, and whether it was clamped.
fn nearest(value: f32) -> (i16, bool) {
    let scaled = libm::roundf(value * 32768.0);
    // The cast saturates and maps NaN to 0.
    let bits = scaled as i16;
    (bits, f32::from(bits) != scaled)
}
