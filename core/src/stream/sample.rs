//! What a processor asks of a sample.

use crate::{Complex32, Sc16};

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

impl Sample for Sc16 {
    const ZERO: Self = Sc16::ZERO;

    fn is_finite(self) -> bool {
        true
    }

    fn at_limit(self) -> bool {
        Sc16::at_limit(self)
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for crate::Complex32 {}
    impl Sealed for crate::Sc16 {}
}
