//! AVX2 and FMA on x86-64: 8 lanes, 16 registers, table lookup in one register at a time.

use std::arch::x86_64::*;

use super::{Kernel, Lanes};

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// `None` if this processor lacks them.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        let there = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        there.then_some(Self(()))
    }

    /// Run `kernel`, compiled for these instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma")]
        fn compiled<K: Kernel>(lanes: Avx2, kernel: K) -> K::Output {
            kernel.run(lanes)
        }
        // SAFETY: `self` exists only where the processor has these instructions.
        unsafe { compiled(self, kernel) }
    }
}

impl Avx2 {
    /// Look up 16 values by the lowest 4 bits of `at`.
    #[inline(always)]
    fn of_16(self, [low, high]: [__m256; 2], at: __m256i) -> __m256 {
        // SAFETY: `self` exists only where the processor has AVX2; the permutation uses the lowest 3 bits of an index, the blend
        // bit 3.
        unsafe {
            let low = _mm256_permutevar8x32_ps(low, at);
            let high = _mm256_permutevar8x32_ps(high, at);
            let upper = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(at));
            _mm256_blendv_ps(low, high, upper)
        }
    }
}

// SAFETY of each block below: `self` exists only where the processor has these instructions; reads and writes have the asserted
// length.
impl Lanes for Avx2 {
    type Numbers = __m256;
    type Narrow = [__m256; 2];
    type Wide = [__m256; 4];
    type Short = __m256;
    type Quarter = __m256;
    const COUNT: usize = 8;
    const LIKES_SHORT: bool = true;

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_set1_ps(x) }
    }
    #[inline(always)]
    fn load(self, from: &[f32]) -> __m256 {
        assert!(from.len() >= 8);
        // SAFETY: as above; 8 numbers are there.
        unsafe { _mm256_loadu_ps(from.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, x: __m256, to: &mut [f32]) {
        assert!(to.len() >= 8);
        // SAFETY: as above; there is room for 8 numbers.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), x) }
    }
    #[inline(always)]
    fn prefetch<T>(self, at: &T) {
        // SAFETY: a prefetch accesses no memory of the program.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(std::ptr::from_ref(at).cast()) }
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_mul_ps(a, b) }
    }
    #[inline(always)]
    fn mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_fmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn mul_sub(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_fmsub_ps(a, b, c) }
    }
    #[inline(always)]
    fn neg_mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_fnmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn unzip(self, a: __m256, b: __m256) -> [__m256; 2] {
        // SAFETY: as above. Within register halves first; then the middle quarters are swapped.
        unsafe {
            let even = _mm256_castps_pd(_mm256_shuffle_ps::<0b10_00_10_00>(a, b));
            let odd = _mm256_castps_pd(_mm256_shuffle_ps::<0b11_01_11_01>(a, b));
            [
                _mm256_castpd_ps(_mm256_permute4x64_pd::<0b11_01_10_00>(even)),
                _mm256_castpd_ps(_mm256_permute4x64_pd::<0b11_01_10_00>(odd)),
            ]
        }
    }
    #[inline(always)]
    fn zip(self, a: __m256, b: __m256) -> [__m256; 2] {
        // SAFETY: as above. Within register halves first; then the halves are put in order.
        unsafe {
            let (low, high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            [
                _mm256_permute2f128_ps::<0x20>(low, high),
                _mm256_permute2f128_ps::<0x31>(low, high),
            ]
        }
    }
    #[inline(always)]
    fn is_equal(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe { _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b), _mm256_set1_ps(1.0)) }
    }
    #[inline(always)]
    fn ends(self, x: __m256) -> [f32; 2] {
        // SAFETY: as above. Halves, quarters, neighbours.
        unsafe {
            let (low, high) = (_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
            let (least, most) = (_mm_min_ps(low, high), _mm_max_ps(low, high));
            let least = _mm_min_ps(least, _mm_movehl_ps(least, least));
            let most = _mm_max_ps(most, _mm_movehl_ps(most, most));
            let least = _mm_min_ss(least, _mm_movehdup_ps(least));
            let most = _mm_max_ss(most, _mm_movehdup_ps(most));
            [_mm_cvtss_f32(least), _mm_cvtss_f32(most)]
        }
    }
    #[inline(always)]
    fn narrow(self, values: &[f32; 16]) -> [__m256; 2] {
        [self.load(values), self.load(&values[8..])]
    }
    #[inline(always)]
    fn of_narrow(self, values: [__m256; 2], at: __m256) -> __m256 {
        // SAFETY: as above.
        let at = unsafe { _mm256_castps_si256(at) };
        self.of_16(values, at)
    }
    #[inline(always)]
    fn wide(self, values: &[f32; 32]) -> [__m256; 4] {
        std::array::from_fn(|i| self.load(&values[8 * i..]))
    }
    #[inline(always)]
    fn of_wide(self, [a, b, c, d]: [__m256; 4], at: __m256) -> __m256 {
        // SAFETY: as above.
        unsafe {
            let at = _mm256_castps_si256(at);
            let (low, high) = (self.of_16([a, b], at), self.of_16([c, d], at));
            let upper = _mm256_castsi256_ps(_mm256_slli_epi32::<27>(at));
            _mm256_blendv_ps(low, high, upper)
        }
    }
    #[inline(always)]
    fn short(self, values: &[f32; 8]) -> __m256 {
        self.load(values)
    }
    #[inline(always)]
    fn of_short(self, values: __m256, at: __m256) -> __m256 {
        // SAFETY: as above; the permutation takes the lowest 3 bits of an index.
        unsafe { _mm256_permutevar8x32_ps(values, _mm256_castps_si256(at)) }
    }
    #[inline(always)]
    fn quarter(self, values: &[f32; 4]) -> __m256 {
        // SAFETY: as above; 4 numbers are there.
        unsafe {
            let values = _mm_loadu_ps(values.as_ptr());
            _mm256_set_m128(values, values)
        }
    }
    #[inline(always)]
    fn of_quarter(self, values: __m256, at: __m256) -> __m256 {
        // SAFETY: as above; the permutation takes the lowest 2 bits of an index, within halves, which are alike.
        unsafe { _mm256_permutevar_ps(values, _mm256_castps_si256(at)) }
    }
}
