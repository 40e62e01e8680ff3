//! Row step of the fixed-point engine: range transform and range gate of one Doppler bin.
//!
//! **Equation**: `out[r] = sum_k X_k exp(+j 2 pi (k - F/2) r / R)`, `|r| <= G`.
//!
//! **Fixed-point scaling.** A mantissa of the column with the largest exponent is scaled by `2^13`, so parts are at
//! most `2^28`, the optimum for the FFT. Columns with an exponent up to 13 lower keep every bit; below that they are
//! rounded. Output is 16-bit mantissas with one exponent per 32 bins.

use num_complex::Complex;

use super::block::{self, Narrowing};
use super::fft;
use crate::Sc16;
use crate::stream::BlockFloat;

/// Left shift from a mantissa to the FFT input, in bits.
const LIFT_BITS: u32 = 13;

/// Fill `work` (`R` points) from the mantissas and column exponents of a row, frequency `k` at index
/// `(k - F/2) mod R`, and transform it. Returns the exponent of a unit of the result.
pub(super) fn compress(row: &[Sc16], exponents: &[i8], work: &mut [Complex<i32>]) -> i32 {
    let length = work.len();
    let highest = exponents.iter().copied().max().unwrap_or(0);
    work.fill(Complex::new(0, 0));
    for (k, (mantissa, exponent)) in row.iter().zip(exponents).enumerate() {
        let place = k.wrapping_sub(exponents.len() / 2) & length.wrapping_sub(1);
        if let Some(value) = work.get_mut(fft::place(place, length)) {
            // 0 to 255.
            let drop = (i32::from(highest) - i32::from(*exponent)) as u32;
            *value = Complex::new(
                lifted(mantissa.re.to_bits(), drop),
                lifted(mantissa.im.to_bits(), drop),
            );
        }
    }
    let shifts = fft::inverse_bounded(work, 15 + LIFT_BITS);
    i32::from(highest) - 15 - LIFT_BITS as i32 + shifts as i32
}

/// `mantissa 2^(13 - drop)` rounded to nearest.
#[inline]
fn lifted(mantissa: i16, drop: u32) -> i32 {
    let value = i32::from(mantissa) << LIFT_BITS;
    if drop <= LIFT_BITS {
        value >> drop
    } else if drop < 31 {
        (value + (1 << (drop - 1))) >> drop
    } else {
        0
    }
}

/// Write the bins `-G ..= G` of the transform in `work` as blocks. Returns the number of clamped samples.
///
/// `out` has `2 G + 1` elements, `exponents` one per block.
pub(super) fn gate(
    work: &[Complex<i32>],
    unit: i32,
    out: &mut [Sc16],
    exponents: &mut [i8],
) -> u32 {
    let reach = out.len() / 2;
    let mut clamped = 0;
    // Bin -G is at index R - G; the others follow cyclically.
    let mut first = work.len().wrapping_sub(reach);
    for (block, exponent) in out.chunks_mut(BlockFloat::BLOCK).zip(exponents) {
        let end = first.wrapping_add(block.len());
        let block_clamped = match work.get(first..end) {
            Some(bins) => narrow(bins.iter().copied(), unit, block, exponent),
            // The block that wraps around.
            None => {
                let mask = work.len().wrapping_sub(1);
                let bin = |place: usize| work.get(place & mask).copied().unwrap_or_default();
                narrow((first..end).map(bin), unit, block, exponent)
            }
        };
        clamped += block_clamped;
        first = end & work.len().wrapping_sub(1);
    }
    clamped
}

/// Write one block. Returns the number of clamped samples.
#[inline]
fn narrow(
    bins: impl Iterator<Item = Complex<i32>> + Clone,
    unit: i32,
    block: &mut [Sc16],
    exponent: &mut i8,
) -> u32 {
    let narrowing = Narrowing::new(bins.clone().fold(0, block::peak), unit);
    *exponent = narrowing.exponent;
    let mut clamped = 0;
    for (sample, bin) in block.iter_mut().zip(bins) {
        let (narrow, was_clamped) = narrowing.apply(bin);
        *sample = narrow;
        clamped += u32::from(was_clamped);
    }
    clamped
}
