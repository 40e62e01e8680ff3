//! What a processor asks of a sample.

use crate::Complex32;

/// A sample as stored.
pub trait Sample: Copy + sealed::Sealed {
    /// Nothing.
    const ZERO: Self;

    /// Whether it is a number.
    fn is_finite(self) -> bool;

    /// Whether a converter was at the end of its range.
    fn at_limit(self) -> bool;
}

impl Sample for Complex32 {
    const ZERO: Self = Complex32::ZERO;

    fn is_finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }

    fn at_limit(self) -> bool {
        false
    }
}

pub(crate) mod sealed {
    /// What only this crate's own samples are.
    pub trait Sealed {}
    impl Sealed for crate::Complex32 {}
}
