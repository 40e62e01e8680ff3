//! One Doppler bin: frequencies to range, and the gate.
//!
//! **Equation**: `out[r] = sum_k X_k exp(+j 2 pi (k - F/2) r / R)`, `|r| <= G`.
//!
//! **Scales.** A mantissa of the column with the largest exponent starts at `2^13` a unit, so parts are
//! at most `2^28`, what the transform wants; a column whose exponent is up to 13 lower keeps every bit,
//! below that it is rounded. Bins come out 16-bit with an exponent for every 32 of them.

use num_complex::Complex;

use super::block::{self, Narrowing};
use super::fft;
use crate::Sc16;
use crate::stream::BlockFloat;

/// Bits between a mantissa and the transform's input.
const LIFT_BITS: u32 = 13;

/// Fills `work`, `R` points, from a row's mantissas and their columns' exponents, frequency `k` at
/// `(k - F/2) mod R`, and transforms it; the power of two that a unit of the result is worth.
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
    let shifts = fft::inverse(work);
    i32::from(highest) - 15 - LIFT_BITS as i32 + shifts as i32
}

/// `mantissa 2^(13 - drop)` to nearest.
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

/// Writes the bins `-G ..= G` of the transform in `work`, in blocks; how many had to be clamped.
///
/// `out` has `2 G + 1` places, `exponents` one for each of its blocks.
pub(super) fn gate(
    work: &[Complex<i32>],
    unit: i32,
    out: &mut [Sc16],
    exponents: &mut [i8],
) -> u32 {
    let reach = out.len() / 2;
    let mut clamped = 0;
    // Bin -G is at R - G; the others follow it round.
    let mut first = work.len().wrapping_sub(reach);
    for (block, exponent) in out.chunks_mut(BlockFloat::BLOCK).zip(exponents) {
        let end = first.wrapping_add(block.len());
        let block_clamped = match work.get(first..end) {
            Some(bins) => narrow(bins.iter().copied(), unit, block, exponent),
            // The one that goes round.
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

/// Writes a block; how many samples had to be clamped.
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
