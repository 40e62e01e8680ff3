//! AVX-512 on x86-64: 16 lanes, 32 registers, table lookup in one or two registers.

use std::arch::x86_64::*;

use super::{Kernel, Lanes};

/// Proof that the processor has AVX-512 F, BW, DQ and VL.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

impl Avx512 {
    /// `None` if this processor lacks them.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        let there = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma");
        there.then_some(Self(()))
    }

    /// Run `kernel`, compiled for these instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
        fn compiled<K: Kernel>(lanes: Avx512, kernel: K) -> K::Output {
            kernel.run(lanes)
        }
        // SAFETY: `self` exists only where the processor has these instructions.
        unsafe { compiled(self, kernel) }
    }
}

// SAFETY of each block below: `self` exists only where the processor has these instructions; reads and writes have the asserted
// length.
impl Lanes for Avx512 {
    type Numbers = __m512;
    type Narrow = __m512;
    type Wide = [__m512; 2];
    type Short = __m512;
    type Quarter = __m512;
    const COUNT: usize = 16;

    #[inline(always)]
    fn splat(self, x: f32) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_set1_ps(x) }
    }
    #[inline(always)]
    fn load(self, from: &[f32]) -> __m512 {
        assert!(from.len() >= 16);
        // SAFETY: as above; 16 numbers are there.
        unsafe { _mm512_loadu_ps(from.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, x: __m512, to: &mut [f32]) {
        assert!(to.len() >= 16);
        // SAFETY: as above; there is room for 16 numbers.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), x) }
    }
    #[inline(always)]
    fn prefetch<T>(self, at: &T) {
        // SAFETY: a prefetch accesses no memory of the program.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(std::ptr::from_ref(at).cast()) }
    }
    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_mul_ps(a, b) }
    }
    #[inline(always)]
    fn mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn mul_sub(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_fmsub_ps(a, b, c) }
    }
    #[inline(always)]
    fn neg_mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe { _mm512_fnmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn unzip(self, a: __m512, b: __m512) -> [__m512; 2] {
        // SAFETY: as above; places 16 to 31 are those of `b`.
        unsafe {
            let even = _mm512_set_epi32(30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0);
            let odd = _mm512_set_epi32(31, 29, 27, 25, 23, 21, 19, 17, 15, 13, 11, 9, 7, 5, 3, 1);
            [
                _mm512_permutex2var_ps(a, even, b),
                _mm512_permutex2var_ps(a, odd, b),
            ]
        }
    }
    #[inline(always)]
    fn zip(self, a: __m512, b: __m512) -> [__m512; 2] {
        // SAFETY: as above; places 16 to 31 are those of `b`.
        unsafe {
            let first = _mm512_set_epi32(23, 7, 22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
            let last = _mm512_add_epi32(first, _mm512_set1_epi32(8));
            [
                _mm512_permutex2var_ps(a, first, b),
                _mm512_permutex2var_ps(a, last, b),
            ]
        }
    }
    #[inline(always)]
    fn is_equal(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as above.
        unsafe {
            let equal = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b);
            _mm512_maskz_mov_ps(equal, _mm512_set1_ps(1.0))
        }
    }
    #[inline(always)]
    fn ends(self, x: __m512) -> [f32; 2] {
        // SAFETY: as above.
        unsafe { [_mm512_reduce_min_ps(x), _mm512_reduce_max_ps(x)] }
    }
    #[inline(always)]
    fn narrow(self, values: &[f32; 16]) -> __m512 {
        self.load(values)
    }
    #[inline(always)]
    fn of_narrow(self, values: __m512, at: __m512) -> __m512 {
        // SAFETY: as above; the permutation takes the lowest 4 bits of an index.
        unsafe { _mm512_permutexvar_ps(_mm512_castps_si512(at), values) }
    }
    #[inline(always)]
    fn wide(self, values: &[f32; 32]) -> [__m512; 2] {
        [self.load(values), self.load(&values[16..])]
    }
    #[inline(always)]
    fn of_wide(self, [low, high]: [__m512; 2], at: __m512) -> __m512 {
        // SAFETY: as above; the permutation takes the lowest 5 bits of an index.
        unsafe { _mm512_permutex2var_ps(low, _mm512_castps_si512(at), high) }
    }
    #[inline(always)]
    fn short(self, values: &[f32; 8]) -> __m512 {
        // SAFETY: as above; 8 numbers are there. Loaded twice, so that bit 3 of an index has no effect.
        unsafe { _mm512_broadcast_f32x8(_mm256_loadu_ps(values.as_ptr())) }
    }
    #[inline(always)]
    fn of_short(self, values: __m512, at: __m512) -> __m512 {
        self.of_narrow(values, at)
    }
    #[inline(always)]
    fn quarter(self, values: &[f32; 4]) -> __m512 {
        // SAFETY: as above; 4 numbers are there.
        unsafe { _mm512_broadcast_f32x4(_mm_loadu_ps(values.as_ptr())) }
    }
    #[inline(always)]
    fn of_quarter(self, values: __m512, at: __m512) -> __m512 {
        // SAFETY: as above; the permutation takes the lowest 2 bits of an index, within quarters, which are alike.
        unsafe { _mm512_permutevar_ps(values, _mm512_castps_si512(at)) }
    }
}
