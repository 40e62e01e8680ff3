//! Block floating-point FFT in 32-bit integers, in place.
//!
//! ```text
//! X[q] = 2^-shifts  sum_p x[p] exp(+j 2 pi p q / N)
//! ```
//! `N` is a power of two from 2 to 4096. Input is in bit-reversed order ([`place`]), so that filling the buffer
//! sorts it at no cost. Output is in natural order.
//!
//! **Algorithm.** Radix-4 decimation in time, preceded by one radix-2 stage if `log2 N` is odd. Each radix-4 stage
//! combines two radix-2 stages, so the order is bit-reversed, not digit-reversed: the middle two of four
//! sub-transforms are exchanged.
//!
//! **Headroom.** Each stage shifts the buffer right until every part is at most `2^28` (`2^29`
//! for radix 2), and only if it is larger. A rotated point is shifted left first, because the rotation drops two bits. Rotation by a twiddle factor increases a part by at most `sqrt 2`. The
//! sum of one unrotated and three rotated parts is at most `(1 + 3 sqrt 2) 2^28 < 2^30.4`. The radix-2 stage
//! comes first, has no twiddle factors, and gives at most `2^30`. No stage overflows.
//!
//! **Accuracy**, relative RMS error: -154 dB or better on noise of amplitude `2^31`, -129 dB on noise of `2^20`,
//! for all lengths (`tests/stream/fixed_stages.rs`). **Cost**: no memory; `N/4 log4 N` radix-4 butterflies of 12
//! multiplications of 32 x 32 bits, whose upper halves are rounded; `N` twiddle factors are read from the table. A stage finds the
//! magnitude of its outputs, except the last one. The first one has no multiplications, and no shifts if the input is at most
//! `2^28` ([`inverse_bounded`]).
//!
//! ```
//! use num_complex::Complex;
//! use subaperture_core::fixed_point::fft;
//! // An impulse at index 1 of 4 gives one full turn over the bins, in the positive sense.
//! let mut x = [Complex::new(0, 0); 4];
//! x[fft::place(1, 4)] = Complex::new(1000, 0);
//! assert_eq!(fft::inverse(&mut x), 0);
//! assert_eq!(x.map(|v| (v.re, v.im)), [(1000, 0), (0, 1000), (-1000, 0), (0, -1000)]);
//! ```

use core::cell::Cell;
use core::hint::black_box;

use num_complex::Complex;

use super::sine;

/// Bit-reversed buffer position of sample `index`; `length` must be a power of two.
#[inline]
pub const fn place(index: usize, length: usize) -> usize {
    let bits = length.trailing_zeros();
    index.reverse_bits().wrapping_shr(usize::BITS - bits)
}

/// Transform `buffer` in place and return the number of bits by which the result was shifted right.
///
/// A buffer whose length is not a power of two from 2 to 4096 is left unchanged.
pub fn inverse(buffer: &mut [Complex<i32>]) -> u32 {
    inverse_bounded(buffer, magnitude_bits(buffer))
}

/// As [`inverse`], for parts known to be in `-2^bits .. 2^bits`, which saves finding their magnitude. Sums of larger parts may
/// overflow.
pub fn inverse_bounded(buffer: &mut [Complex<i32>], mut bits: u32) -> u32 {
    let length = buffer.len();
    if !crate::fft::supports(length) {
        return 0;
    }
    let mut shifts = 0;
    let mut part = 1;
    if length.ilog2() % 2 == 1 {
        let shift = bits.saturating_sub(RADIX_2_BITS);
        bits = radix_2(buffer, shift);
        shifts += shift;
        part = 2;
    }
    while part < length {
        let mut shift = bits.saturating_sub(RADIX_4_BITS);
        if shift > QUARTER_BITS {
            // By one bit more.
            buffer.iter_mut().for_each(|value| *value = halved(*value));
            shifts += 1;
            shift = QUARTER_BITS;
        }
        bits = match 4 * part < length {
            true => radix_4::<false>(buffer, part, shift),
            false => radix_4::<true>(buffer, part, shift),
        };
        shifts += shift;
        part *= 4;
    }
    shifts
}

/// Maximum magnitude of the parts before a stage, as a power of two.
const RADIX_2_BITS: u32 = 29;
const RADIX_4_BITS: u32 = 28;

/// Bits that a rotation drops ([`sine::product`]): the maximum shift of a radix-4 stage.
const QUARTER_BITS: u32 = 2;

/// Smallest `b` such that every part is in `-2^b .. 2^b`.
fn magnitude_bits(buffer: &[Complex<i32>]) -> u32 {
    let mask = buffer
        .iter()
        .fold(0, |mask, value| mask | magnitude_mask(*value));
    u32::BITS - mask.leading_zeros()
}

/// Bitwise OR of both parts' magnitudes (of a negative part, the magnitude minus one).
#[inline]
fn magnitude_mask(value: Complex<i32>) -> u32 {
    ((value.re ^ (value.re >> 31)) | (value.im ^ (value.im >> 31))) as u32
}

/// `value 2^-shift` rounded to nearest; `shift` at most 3, shifted parts at most `2^29`.
#[inline]
fn shifted(value: Complex<i32>, shift: u32) -> Complex<i32> {
    // One extra bit is kept to round halves up within 32 bits.
    let last = shift.min(1);
    let part = |x: i32| ((x >> (shift - last)) + last as i32) >> last;
    Complex::new(part(value.re), part(value.im))
}

/// `value / 2` rounded to nearest, for every value.
#[inline]
fn halved(value: Complex<i32>) -> Complex<i32> {
    let part = |x: i32| (x >> 1) + (x & 1);
    Complex::new(part(value.re), part(value.im))
}

/// Radix-2 stage on adjacent pairs. Returns the magnitude bits of the result.
fn radix_2(buffer: &mut [Complex<i32>], shift: u32) -> u32 {
    let mut mask = 0;
    let (pairs, _) = buffer.as_chunks_mut::<2>();
    for [a, b] in pairs {
        let (x, y) = (shifted(*a, shift), shifted(*b, shift));
        (*a, *b) = (x + y, x - y);
        mask |= magnitude_mask(*a) | magnitude_mask(*b);
    }
    u32::BITS - mask.leading_zeros()
}

/// Radix-4 stage: combine four transforms of `part` points. Returns the magnitude bits of the result, or 32 for the last stage.
///
/// Butterflies with the same twiddle factors, one in each block of `4 part` points, follow each other.
fn radix_4<const LAST: bool>(buffer: &mut [Complex<i32>], part: usize, shift: u32) -> u32 {
    let mut mask = if LAST { u32::MAX } else { 0 };
    // Products are a quarter of the rotated values.
    let left = QUARTER_BITS - shift;
    // Twiddle factor j of 4 part points is table point j stride of 4096; part is at least 1.
    let stride = (sine::POINTS / 4) >> part.ilog2();
    let buffer = Cell::from_mut(buffer).as_slice_of_cells();
    // The first stage rarely shifts, and has no other butterflies.
    for block in buffer.chunks_exact(4 * part) {
        mask |= match shift {
            0 => butterfly(block, 0, part, |y, _| y),
            _ => butterfly(block, 0, part, |y, _| shifted(y, shift)),
        };
    }
    for j in 1..part {
        let twiddles = [1, 2, 3].map(|n| sine::unit(n * j * stride));
        for block in buffer.chunks_exact(4 * part) {
            let own = butterfly(block, j, part, |y, n| {
                match twiddles.get(n.wrapping_sub(1)) {
                    Some(twiddle) => {
                        let y = Complex::new(y.re.wrapping_shl(left), y.im.wrapping_shl(left));
                        sine::product(y, *twiddle)
                    }
                    None => shifted(y, shift),
                }
            });
            mask |= if LAST { 0 } else { own };
        }
    }
    u32::BITS - mask.leading_zeros()
}

/// Butterfly of the points `j` of four transforms in `block`. `rotated` shifts a point and applies the twiddle factor of its number, 0 to
/// 3. Returns the magnitude mask of the result.
#[inline(always)]
fn butterfly(
    block: &[Cell<Complex<i32>>],
    j: usize,
    part: usize,
    rotated: impl Fn(Complex<i32>, usize) -> Complex<i32>,
) -> u32 {
    // Bit-reversed order: the sub-transform of samples 4n + 2 precedes that of 4n + 1.
    let at = |n: usize| block.get(j + n * part);
    let (Some(a), Some(c), Some(b), Some(d)) = (at(0), at(1), at(2), at(3)) else {
        return 0;
    };
    let (y1, y3) = (rotated(b.get(), 1), rotated(d.get(), 3));
    let (t2, t3) = (y1 + y3, y1 - y3);
    let t3 = Complex::new(-t3.im, t3.re);
    // Keeps the compiler from loading the other two before: the registers do not hold all.
    black_box(());
    let (y0, y2) = (rotated(a.get(), 0), rotated(c.get(), 2));
    let (t0, t1) = (y0 + y2, y0 - y2);
    // Outputs j + q part: zeroth, second, first and third are stored at offsets of 0, 1, 2 and 3 parts.
    let outputs = [t0 + t2, t1 + t3, t0 - t2, t1 - t3];
    let mut mask = 0;
    for (place, output) in [a, c, b, d].into_iter().zip(outputs) {
        place.set(output);
        mask |= magnitude_mask(output);
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shift_rounds_to_nearest_for_every_magnitude_a_stage_shifts() {
        for shift in 0..=3u32 {
            let most = if shift > 1 { i32::MAX } else { 1 << 30 };
            for distance in 0..100 {
                for x in [most - distance, -most + distance, distance, -distance] {
                    let exact = (i64::from(x) + ((1 << shift) >> 1)) >> shift;
                    let value = shifted(Complex::new(x, x), shift);
                    assert_eq!(i64::from(value.re), exact);
                    assert_eq!(i64::from(value.im), exact);
                }
            }
        }
    }
}
