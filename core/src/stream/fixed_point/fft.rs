//! The discrete Fourier transform in 32-bit integers, block floating point, in place.
//!
//! ```text
//! X[q] = 2^-shifts  sum_p x[p] exp(+j 2 pi p q / N)
//! ```
//! `N` is a power of two from 2 to 4096. Input lies in bit-reversed order ([`place`]), so that whoever
//! fills the buffer sorts it at no cost; output is in natural order.
//!
//! **Way.** Decimation in time by radix 4, after one stage of radix 2 where `log2 N` is odd. Two stages
//! of radix 2 make one of radix 4, so the order is that of bits, not of digits: the middle two of four
//! parts change places.
//!
//! **No overflow.** Before a stage its input is shifted right, all of it alike, until every part is at
//! most `2^28` (`2^29` for radix 2), and only if it is larger. Turned by a twiddle a part is at most
//! `sqrt 2` times that; a sum of one part as it is and three turned is at most `(1 + 3 sqrt 2) 2^28 <
//! 2^30.4`. Radix 2 comes first, has no twiddles, and gives at most `2^30`.
//!
//! **Accuracy**, error relative in RMS: -152 dB or better on noise of amplitude `2^31`, -131 dB on noise
//! of `2^20`, all lengths (`tests/stream/fixed_stages.rs`). **Cost**: no memory; a radix-4 butterfly is 12
//! multiplications of 32 to 64 bits, and there are `N/4 log4 N` of them.
//!
//! ```
//! use num_complex::Complex;
//! use subaperture_core::fixed_point::fft;
//! // One at place 1 of 4 is a full turn over the bins, in the positive sense.
//! let mut x = [Complex::new(0, 0); 4];
//! x[fft::place(1, 4)] = Complex::new(1000, 0);
//! assert_eq!(fft::inverse(&mut x), 0);
//! assert_eq!(x.map(|v| (v.re, v.im)), [(1000, 0), (0, 1000), (-1000, 0), (0, -1000)]);
//! ```

use num_complex::Complex;

use super::sine;

/// Where sample `index` of `length`, a power of two, goes in the buffer: its bits reversed.
#[inline]
pub const fn place(index: usize, length: usize) -> usize {
    let bits = length.trailing_zeros();
    index.reverse_bits().wrapping_shr(usize::BITS - bits)
}

/// Transforms `buffer` in place and says by how many bits the result was shifted right.
///
/// A length that is no power of two from 2 to 4096 is left as it is.
pub fn inverse(buffer: &mut [Complex<i32>]) -> u32 {
    let length = buffer.len();
    if !crate::fft::supports(length) {
        return 0;
    }
    let mut bits = magnitude_bits(buffer);
    let mut shifts = 0;
    let mut part = 1;
    if length.ilog2() % 2 == 1 {
        let shift = bits.saturating_sub(RADIX_2_BITS);
        bits = radix_2(buffer, shift);
        shifts += shift;
        part = 2;
    }
    while part < length {
        let shift = bits.saturating_sub(RADIX_4_BITS);
        bits = radix_4(buffer, part, shift);
        shifts += shift;
        part *= 4;
    }
    shifts
}

/// A part of input to a stage is at most 2 to these.
const RADIX_2_BITS: u32 = 29;
const RADIX_4_BITS: u32 = 28;

/// The smallest `b` with every part in `-2^b .. 2^b`.
fn magnitude_bits(buffer: &[Complex<i32>]) -> u32 {
    let mask = buffer.iter().fold(0, |mask, value| mask | ones(*value));
    u32::BITS - mask.leading_zeros()
}

/// The bits of both parts' magnitudes, or'ed (that of a negative part less one).
#[inline]
fn ones(value: Complex<i32>) -> u32 {
    ((value.re ^ (value.re >> 31)) | (value.im ^ (value.im >> 31))) as u32
}

/// `value 2^-shift` to nearest, `shift` at most 3 and parts at most `2^31 - 1` as shifted.
#[inline]
fn shifted(value: Complex<i32>, shift: u32) -> Complex<i32> {
    // Truncation and then the bit below, none for no shift: adding a half first could pass 2^31.
    let part = |x: i32| (x >> shift) + (((x << 1) >> shift) & 1);
    Complex::new(part(value.re), part(value.im))
}

/// Pairs of neighbours; the magnitude bits of the result.
fn radix_2(buffer: &mut [Complex<i32>], shift: u32) -> u32 {
    let mut mask = 0;
    let (pairs, _) = buffer.as_chunks_mut::<2>();
    for [a, b] in pairs {
        let (x, y) = (shifted(*a, shift), shifted(*b, shift));
        (*a, *b) = (x + y, x - y);
        mask |= ones(*a) | ones(*b);
    }
    u32::BITS - mask.leading_zeros()
}

/// Makes transforms of `4 part` points from four of `part`; the magnitude bits of the result.
fn radix_4(buffer: &mut [Complex<i32>], part: usize, shift: u32) -> u32 {
    let mut mask = 0;
    // Twiddle j of 4 part points is point j stride of the 4096; part is at least 1.
    let stride = (sine::POINTS / 4) >> part.ilog2();
    for block in buffer.chunks_exact_mut(4 * part) {
        let Some((lower, upper)) = block.split_at_mut_checked(2 * part) else {
            continue;
        };
        let Some((zeroth, second)) = lower.split_at_mut_checked(part) else {
            continue;
        };
        let Some((first, third)) = upper.split_at_mut_checked(part) else {
            continue;
        };
        // Bit-reversed: the part of samples 4n + 2 lies before that of 4n + 1.
        let lower = zeroth.iter_mut().zip(second);
        let upper = first.iter_mut().zip(third);
        for (j, ((a, c), (b, d))) in lower.zip(upper).enumerate() {
            let [y0, mut y1, mut y2, mut y3] = [*a, *b, *c, *d].map(|y| shifted(y, shift));
            if j > 0 {
                y1 = sine::turned(y1, sine::unit(j * stride));
                y2 = sine::turned(y2, sine::unit(2 * j * stride));
                y3 = sine::turned(y3, sine::unit(3 * j * stride));
            }
            let (t0, t1, t2, t3) = (y0 + y2, y0 - y2, y1 + y3, y1 - y3);
            let t3 = Complex::new(-t3.im, t3.re);
            // Output j + q part: the places of zeroth, second, first, third are 0, 1, 2, 3 parts on.
            (*a, *c, *b, *d) = (t0 + t2, t1 + t3, t0 - t2, t1 - t3);
            mask |= ones(*a) | ones(*b) | ones(*c) | ones(*d);
        }
    }
    u32::BITS - mask.leading_zeros()
}
