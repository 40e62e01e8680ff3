//! Places without a recorded sample in a row of samples.

use num_complex::Complex32;

/// Place without a recorded sample.
#[cfg(feature = "cphd")]
pub(crate) const ABSENT: Complex32 = Complex32::new(f32::NAN, f32::NAN);

/// Whether a place has no recorded sample.
pub(super) fn is_absent(z: Complex32) -> bool {
    z.re.is_nan()
}
