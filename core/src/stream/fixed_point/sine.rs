//! Integer sine and cosine from a quarter-wave table.
//!
//! **Equation.** The table holds `sin(2 pi i / 4096)`, `i = 0..=1024`, in units of `2^-30` ([`ONE`] is 1).
//! A phase is rounded to the nearest of 4096 points and corrected for the remainder `|delta| <= 2 pi / 8192`:
//!
//! ```text
//! cos(x + delta) = cos x - (delta sin x + delta^2/2 cos x)
//! sin(x + delta) = sin x + (delta cos x - delta^2/2 sin x)
//! ```
//!
//! **Neglected**: the cubic term, `delta^3 / 6 < 7.6e-11 = 0.08` units. **Accuracy**: the error of a part is below
//! 2 units of `2^-30`: phase rounded to `2^-32` turns (at most 0.79), table (0.5), final rounding (0.5), cubic
//! term (0.08). `tests/stream/fixed_stages.rs` verifies it. Multiples of `1/4096` turn return table values.
//!
//! **Cost**: 4100 bytes of constants and six multiplications of 32 x 32 to 64 bits.
//!
//! ```
//! use subaperture_core::{Turns, fixed_point::sine};
//! let quarter = sine::phasor(Turns::from_f64(0.25));
//! assert_eq!((quarter.re, quarter.im), (0, sine::ONE));
//! ```

use num_complex::Complex;

use crate::Turns;

/// The number 1 in units of this module, `2^30`.
pub const ONE: i32 = 1 << FRACTION_BITS;

/// Number of fraction bits.
pub const FRACTION_BITS: u32 = 30;

/// Number of points of [`unit()`] per turn.
pub const POINTS: usize = 4096;

const QUARTER: usize = POINTS / 4;

/// A static, not a constant, so that one copy exists.
static SINE: [i32; QUARTER + 1] = quarter_wave();

/// `sin(2 pi i / 4096)` rounded to nearest. Evaluated in float64 at compile time, bit-identical on every machine.
const fn quarter_wave() -> [i32; QUARTER + 1] {
    let mut table = [0; QUARTER + 1];
    let mut i = 0;
    while i <= QUARTER {
        let x = core::f64::consts::TAU * i as f64 / POINTS as f64;
        // Taylor series; (pi/2)^25 / 25! is 5e-21.
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        while n < 24.0 {
            term *= -x * x / ((n + 1.0) * (n + 2.0));
            sum += term;
            n += 2.0;
        }
        table[i] = (sum * ONE as f64 + 0.5) as i32;
        i += 1;
    }
    table
}

/// Phasor of a table point, `exp(+j 2 pi index / 4096)`.
#[inline]
pub fn unit(index: usize) -> Complex<i32> {
    let half = index % (2 * QUARTER);
    // Within the table of 1025 entries, since `half` is at most 2047.
    let complement = half.abs_diff(QUARTER);
    let at = |place: usize| SINE.get(place).copied().unwrap_or(0);
    let (cos, sin) = (at(complement), at(QUARTER - complement));
    // Without branches: -1 where a part changes its sign, otherwise 0.
    let sign = |bit: usize| -((bit / QUARTER / 2 % 2) as i32);
    let signed = |part: i32, sign: i32| (part ^ sign) - sign;
    Complex::new(signed(cos, sign(index + QUARTER)), signed(sin, sign(index)))
}

/// Phasor of a phase, `exp(+j 2 pi t)`.
pub fn phasor(turns: Turns) -> Complex<i32> {
    of_phase(phase(turns))
}

/// Phase rounded to units of `2^-32` turns.
#[inline]
pub(super) fn phase(turns: Turns) -> u32 {
    // One turn wraps.
    ((turns.0 >> 32) as u32).wrapping_add((turns.0 >> 31) as u32 & 1)
}

/// Phasor of a phase in units of `2^-32` turns.
#[inline]
pub(super) fn of_phase(phase: u32) -> Complex<i32> {
    let index = phase.wrapping_add(1 << (STEP_BITS - 1)) >> STEP_BITS;

    // delta and delta^2 / 2 in units of 2^-40 are below 2^30 and 2^19, so both fit 32 bits and every product is
    // 32 x 32 bits. The shift drops the index, and leaves `rest 2^12`.
    let delta = upper(i64::from((phase << 12) as i32) * TAU_2_28);
    let half_square = upper(i64::from(delta) * i64::from(delta)) >> 9;
    let (delta, half_square) = (i64::from(delta), i64::from(half_square));
    let Complex { re: cos, im: sin } = unit(index as usize);
    let (wide_cos, wide_sin) = (i64::from(cos), i64::from(sin));
    // Each below 2^61.
    let less = wide_sin * delta + wide_cos * half_square;
    let more = wide_cos * delta + wide_sin * -half_square;
    Complex::new(
        cos - (upper(less + HALF) >> 8),
        sin + (upper(more + HALF) >> 8),
    )
}

/// Upper half of a product.
#[inline]
fn upper(x: i64) -> i32 {
    (x >> 32) as i32
}

/// Rotate `value` by a phasor, with an error of at most 4 units per part. Parts of `value` must be at most `2^30.4`, so that the
/// result stays below `2^31`.
#[inline]
pub(super) fn rotated(value: Complex<i32>, phasor: Complex<i32>) -> Complex<i32> {
    let quarter = product(value, phasor);
    Complex::new(quarter.re << 2, quarter.im << 2)
}

/// `2^-32 value phasor`, with each of the two products of a part rounded: a quarter of `value` rotated by the phasor. Cortex-M4 and
/// M7 have an instruction for a product with its rounding and sum.
#[inline]
pub(super) fn product(value: Complex<i32>, phasor: Complex<i32>) -> Complex<i32> {
    let times = |x: i32, y: i32| i64::from(x) * i64::from(y);
    let first = |x: i32, y: i32| upper(times(x, y) + (1 << 31));
    let wide = |x: i32| i64::from(x) << 32;
    let (a, b) = (first(value.re, phasor.re), first(value.re, phasor.im));
    Complex::new(
        // A sum: the compiler merges the carry of a difference with later sums.
        upper(wide(a) + times(value.im, -phasor.im) + (1 << 31)),
        upper(wide(b) + times(value.im, phasor.re) + (1 << 31)),
    )
}

const STEP_BITS: u32 = 32 - POINTS.ilog2();
const HALF: i64 = 1 << 39;

/// `2 pi` in units of `2^-28`: `rest TAU_2_28` is `delta` in units of `2^-60`.
const TAU_2_28: i64 = (core::f64::consts::TAU * (1u64 << 28) as f64 + 0.5) as i64;
