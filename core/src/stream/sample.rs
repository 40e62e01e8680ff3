//! Sample types of the stream processor.

use crate::Complex32;

/// Stored sample: [`Complex32`] or, with the feature `fixed`, `Sc16`.
pub trait Sample: Copy + sealed::Sealed {
    /// Zero sample.
    const ZERO: Self;

    /// Whether both parts are finite. Always true for integers.
    fn is_finite(self) -> bool;

    /// Whether a part is at a limit of the converter's range. Always false for floating point.
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
    /// Seals [`super::Sample`]: only this crate implements it.
    pub trait Sealed {}
    impl Sealed for crate::Complex32 {}
}
