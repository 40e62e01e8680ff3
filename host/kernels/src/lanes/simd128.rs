//! WebAssembly's 128-bit instructions: 4 lanes, byte-wise table lookup.
//!
//! The instruction set has no fused multiply-add that is the same on every machine. [`Simd128`] without `FUSED` adds the exact product in
//! float64. The second rounding, to float32, changes the result only where the sum lies on the midpoint of two float32 numbers or is below
//! the smallest normal one; those are computed again by [`f32::mul_add`].
//!
//! With `FUSED`, in modules compiled with relaxed instructions, it takes `relaxed_madd`. The machine decides whether that is fused, with the
//! same result throughout a run. [`Simd128::new`] probes it, and plain Rust takes its place where it is not, so that results are bit-identical.
//! Such a module has no lanes without `FUSED`, which take as long to compile as all others: the web page loads the other module instead.

use std::arch::wasm32::*;

use super::{Kernel, Lanes};

/// Lanes of this module's instructions; `FUSED` where `relaxed_madd` is rounded once.
#[derive(Clone, Copy)]
pub(crate) struct Simd128<const FUSED: bool>(());

#[cfg(any(test, not(target_feature = "relaxed-simd")))]
impl Simd128<false> {
    /// A module with these instructions is loaded only where they exist.
    #[inline]
    pub(crate) fn new() -> Self {
        Self(())
    }
}

#[cfg(target_feature = "relaxed-simd")]
impl Simd128<true> {
    /// `None` where products are rounded before they are added.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        // The square is 1 + 2^-11 + 2^-24; float32 holds only the first two terms.
        let x = std::hint::black_box(1.0 + 1.0 / 4096.0);
        let x = f32x4_splat(x);
        let sum = f32x4_relaxed_nmadd(x, x, f32x4_splat(1.0 + 1.0 / 2048.0));
        (f32x4_extract_lane::<0>(sum) == -1.0 / 16_777_216.0).then_some(Self(()))
    }
}

impl<const FUSED: bool> Simd128<FUSED> {
    /// Run `kernel` in these lanes.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }
}

/// `a b + c` of the first two lanes in float64, where the product is exact.
#[inline(always)]
fn wide_sum(a: v128, b: v128, c: v128) -> v128 {
    let [a, b, c] = [a, b, c].map(|x| f64x2_promote_low_f32x4(x));
    f64x2_add(f64x2_mul(a, b), c)
}

/// Whether a float64 lies on the midpoint of two normal float32 numbers.
#[inline(always)]
fn is_midpoint(sum: v128) -> v128 {
    let below = v128_and(sum, u64x2_splat(0x1fff_ffff));
    u64x2_eq(below, u64x2_splat(0x1000_0000))
}

/// `a b + c`, rounded once.
#[inline(always)]
fn fused(a: v128, b: v128, c: v128) -> v128 {
    let last = |x| u32x4_shuffle::<2, 3, 2, 3>(x, x);
    let sums = [wide_sum(a, b, c), wide_sum(last(a), last(b), last(c))];
    let [first, second] = sums.map(|sum| f32x4_demote_f64x2_zero(sum));
    let rounded = u32x4_shuffle::<0, 1, 4, 5>(first, second);
    let midpoint = v128_or(is_midpoint(sums[0]), is_midpoint(sums[1]));
    let small = f32x4_le(f32x4_abs(rounded), f32x4_splat(f32::MIN_POSITIVE));
    if v128_any_true(v128_or(midpoint, small)) {
        return checked(a, b, c, sums, rounded);
    }
    rounded
}

/// `rounded`, or the numbers computed again where the second rounding may have changed them. Zeros are exact.
#[cold]
#[inline(never)]
fn checked(a: v128, b: v128, c: v128, sums: [v128; 2], rounded: v128) -> v128 {
    let doubtful = |sum| {
        let small = f64x2_le(f64x2_abs(sum), f64x2_splat(f64::from(f32::MIN_POSITIVE)));
        let small = v128_and(small, f64x2_ne(sum, f64x2_splat(0.0)));
        v128_or(is_midpoint(sum), small)
    };
    if !v128_any_true(v128_or(doubtful(sums[0]), doubtful(sums[1]))) {
        return rounded;
    }
    let [a, b, c] = [a, b, c].map(numbers);
    let each = |i: usize| a[i].mul_add(b[i], c[i]);
    f32x4(each(0), each(1), each(2), each(3))
}

fn numbers(x: v128) -> [f32; 4] {
    [
        f32x4_extract_lane::<0>(x),
        f32x4_extract_lane::<1>(x),
        f32x4_extract_lane::<2>(x),
        f32x4_extract_lane::<3>(x),
    ]
}

/// Byte indices of the numbers selected by the bits of `at` under `mask`: number `i` occupies bytes `4 i` to `4 i + 3`.
#[inline(always)]
fn bytes(at: v128, mask: u32) -> v128 {
    let first = u32x4_mul(v128_and(at, u32x4_splat(mask)), u32x4_splat(0x0404_0404));
    u32x4_add(first, u32x4_splat(0x0302_0100))
}

/// Look up bytes in consecutive registers: an index outside a register gives 0.
#[inline(always)]
fn look_up<const COUNT: usize>(values: [v128; COUNT], at: v128) -> v128 {
    let mut found = u8x16_swizzle(values[0], at);
    for (i, &part) in values.iter().enumerate().skip(1) {
        let within = u8x16_sub(at, u8x16_splat(16 * i as u8));
        found = v128_or(found, u8x16_swizzle(part, within));
    }
    found
}

/// The table of consecutive numbers in registers.
#[inline(always)]
fn table<const COUNT: usize>(values: &[f32]) -> [v128; COUNT] {
    std::array::from_fn(|i| load(&values[4 * i..]))
}

#[inline(always)]
fn load(from: &[f32]) -> v128 {
    let &[a, b, c, d] = from.first_chunk().expect("4 numbers");
    f32x4(a, b, c, d)
}

impl<const FUSED: bool> Lanes for Simd128<FUSED> {
    type Numbers = v128;
    type Narrow = [v128; 4];
    type Wide = [v128; 8];
    type Short = [v128; 2];
    type Quarter = [v128; 1];
    const COUNT: usize = 4;
    const LIKES_SHORT: bool = true;

    #[inline(always)]
    fn splat(self, x: f32) -> v128 {
        f32x4_splat(x)
    }
    #[inline(always)]
    fn load(self, from: &[f32]) -> v128 {
        load(from)
    }
    #[inline(always)]
    fn store(self, x: v128, to: &mut [f32]) {
        to[..4].copy_from_slice(&numbers(x));
    }
    #[inline(always)]
    fn add(self, a: v128, b: v128) -> v128 {
        f32x4_add(a, b)
    }
    #[inline(always)]
    fn sub(self, a: v128, b: v128) -> v128 {
        f32x4_sub(a, b)
    }
    #[inline(always)]
    fn mul(self, a: v128, b: v128) -> v128 {
        f32x4_mul(a, b)
    }
    #[inline(always)]
    fn mul_add(self, a: v128, b: v128, c: v128) -> v128 {
        #[cfg(target_feature = "relaxed-simd")]
        if FUSED {
            return f32x4_relaxed_madd(a, b, c);
        }
        fused(a, b, c)
    }
    #[inline(always)]
    fn mul_sub(self, a: v128, b: v128, c: v128) -> v128 {
        self.mul_add(a, b, f32x4_neg(c))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: v128, b: v128, c: v128) -> v128 {
        #[cfg(target_feature = "relaxed-simd")]
        if FUSED {
            return f32x4_relaxed_nmadd(a, b, c);
        }
        self.mul_add(f32x4_neg(a), b, c)
    }
    #[inline(always)]
    fn unzip(self, a: v128, b: v128) -> [v128; 2] {
        [
            u32x4_shuffle::<0, 2, 4, 6>(a, b),
            u32x4_shuffle::<1, 3, 5, 7>(a, b),
        ]
    }
    #[inline(always)]
    fn zip(self, a: v128, b: v128) -> [v128; 2] {
        [
            u32x4_shuffle::<0, 4, 1, 5>(a, b),
            u32x4_shuffle::<2, 6, 3, 7>(a, b),
        ]
    }
    #[inline(always)]
    fn is_equal(self, a: v128, b: v128) -> v128 {
        v128_and(f32x4_eq(a, b), f32x4_splat(1.0))
    }
    #[inline(always)]
    fn ends(self, x: v128) -> [f32; 2] {
        let pairs = u32x4_shuffle::<2, 3, 0, 1>(x, x);
        let [least, most] = [f32x4_pmin(x, pairs), f32x4_pmax(x, pairs)];
        let [other_least, other_most] = [least, most].map(|x| u32x4_shuffle::<1, 0, 3, 2>(x, x));
        [
            f32x4_extract_lane::<0>(f32x4_pmin(least, other_least)),
            f32x4_extract_lane::<0>(f32x4_pmax(most, other_most)),
        ]
    }
    #[inline(always)]
    fn narrow(self, values: &[f32; 16]) -> [v128; 4] {
        table(values)
    }
    #[inline(always)]
    fn of_narrow(self, values: [v128; 4], at: v128) -> v128 {
        look_up(values, bytes(at, 15))
    }
    #[inline(always)]
    fn wide(self, values: &[f32; 32]) -> [v128; 8] {
        table(values)
    }
    #[inline(always)]
    fn of_wide(self, values: [v128; 8], at: v128) -> v128 {
        look_up(values, bytes(at, 31))
    }
    #[inline(always)]
    fn short(self, values: &[f32; 8]) -> [v128; 2] {
        table(values)
    }
    #[inline(always)]
    fn of_short(self, values: [v128; 2], at: v128) -> v128 {
        look_up(values, bytes(at, 7))
    }
    #[inline(always)]
    fn quarter(self, values: &[f32; 4]) -> [v128; 1] {
        table(values)
    }
    #[inline(always)]
    fn of_quarter(self, values: [v128; 1], at: v128) -> v128 {
        look_up(values, bytes(at, 3))
    }
}
