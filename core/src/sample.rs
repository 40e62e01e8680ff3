//! 16-bit complex samples, as a converter delivers them.

use fixed::types::I1F15;
use num_complex::Complex32;

use crate::stream::{Sample, Sealed};

/// A complex sample of 16-bit parts in `[-1, 1)`: `sc16`, the converter's and the radio's own format.
///
/// ```
/// use subaperture_core::{Complex32, Sc16};
/// let sample = Sc16::from_bits(16384, -32768);
/// assert_eq!(sample.to_complex32(), Complex32::new(0.5, -1.0));
/// // Out of range: the nearest that there is, and the caller is told.
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
    /// Zero.
    pub const ZERO: Self = Self::from_bits(0, 0);

    /// The sample of these integers, in units of `2^-15`.
    pub const fn from_bits(re: i16, im: i16) -> Self {
        Self {
            re: I1F15::from_bits(re),
            im: I1F15::from_bits(im),
        }
    }

    /// Its value; exact.
    pub fn to_complex32(self) -> Complex32 {
        const UNIT: f32 = 1.0 / 32768.0;
        Complex32::new(
            f32::from(self.re.to_bits()) * UNIT,
            f32::from(self.im.to_bits()) * UNIT,
        )
    }

    /// The nearest sample, halves away from zero, and whether a part was out of range and was clamped
    /// (not a number becomes zero, and counts).
    pub fn from_complex32(value: Complex32) -> (Self, bool) {
        let (re, clamped_re) = nearest(value.re);
        let (im, clamped_im) = nearest(value.im);
        (Self::from_bits(re, im), clamped_re || clamped_im)
    }

    /// Whether a part is at either end of its range, where a converter clips.
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

/// `value` in units of `2^-15`, and whether it had to be clamped.
fn nearest(value: f32) -> (i16, bool) {
    let scaled = libm::roundf(value * 32768.0);
    // The cast saturates, and makes 0 of what is not a number.
    let bits = scaled as i16;
    (bits, f32::from(bits) != scaled)
}
