//! Noncoherent accumulation: sum of the power of maps, bin by bin.
//!
//! **Equation**: `power[d][r] += |map[d][r]|^2`. **Neglected**: migration between sub-CPIs; a scatterer must stay
//! within one bin. Patch maps are relative to the patch centre, where it does so for longer. **Cost**: 4 bytes per bin;
//! two multiply-adds per bin and map. **Accuracy**: relative error of a sum of `n` float32 terms below
//! `(n + 2) 2^-24` (`tests/stream/accumulate.rs`).

use num_complex::Complex32;

use crate::LengthError;

/// Add the power of `samples` to `power`, element by element. `power` may be the real parts of pixels.
///
/// ```
/// use subaperture_core::Complex32;
/// use subaperture_core::accumulate::add_power;
/// let mut power = [1.0];
/// add_power(&mut power, &[Complex32::new(3.0, 4.0)])?;
/// assert_eq!(power, [26.0]);
/// # Ok::<(), subaperture_core::LengthError>(())
/// ```
///
/// # Errors
/// [`LengthError`] if the lengths differ. Nothing is then written.
pub fn add_power<'a>(
    power: impl IntoIterator<Item = &'a mut f32, IntoIter: ExactSizeIterator>,
    samples: &[Complex32],
) -> Result<(), LengthError> {
    let power = power.into_iter();
    LengthError::check("power", samples.len(), power.len())?;
    for (sum, sample) in power.zip(samples) {
        *sum += sample.norm_sqr();
    }
    Ok(())
}
