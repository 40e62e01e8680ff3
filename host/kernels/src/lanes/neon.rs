//! NEON on aarch64: 4 lanes, byte-wise table lookup in up to four registers.

use std::arch::aarch64::*;

use super::{Kernel, Lanes};

/// Proof that the processor has NEON.
#[derive(Clone, Copy)]
pub(crate) struct Neon(());

impl Neon {
    /// `None` if this processor lacks it.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        std::arch::is_aarch64_feature_detected!("neon").then_some(Self(()))
    }

    /// Run `kernel`, compiled for these instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "neon")]
        fn compiled<K: Kernel>(lanes: Neon, kernel: K) -> K::Output {
            kernel.run(lanes)
        }
        // SAFETY: `self` exists only where the processor has these instructions.
        unsafe { compiled(self, kernel) }
    }
}

impl Neon {
    /// Byte indices of the numbers selected by the bits of `at` under `mask`.
    #[inline(always)]
    fn bytes(self, at: float32x4_t, mask: u32) -> uint8x16_t {
        // SAFETY: `self` exists only where the processor has NEON. Number `i` occupies bytes `4 i` to `4 i + 3`: four times `4 i`,
        // plus 0 to 3.
        unsafe {
            let index = vandq_u32(vreinterpretq_u32_f32(at), vdupq_n_u32(mask));
            let first = vmulq_n_u32(index, 0x0404_0404);
            vreinterpretq_u8_u32(vaddq_u32(first, vdupq_n_u32(0x0302_0100)))
        }
    }

    /// Table of 16 numbers as bytes.
    #[inline(always)]
    fn table(self, values: &[f32; 16]) -> uint8x16x4_t {
        // SAFETY: `self` exists only where the processor has NEON; 64 bytes are 16 numbers.
        unsafe { vld1q_u8_x4(values.as_ptr().cast()) }
    }
}

// SAFETY of each block below: `self` exists only where the processor has these instructions; reads and writes have the asserted
// length.
impl Lanes for Neon {
    type Numbers = float32x4_t;
    type Narrow = uint8x16x4_t;
    type Wide = [uint8x16x4_t; 2];
    type Short = uint8x16x2_t;
    type Quarter = uint8x16_t;
    const COUNT: usize = 4;
    const LIKES_SHORT: bool = true;

    #[inline(always)]
    fn splat(self, x: f32) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vdupq_n_f32(x) }
    }
    #[inline(always)]
    fn load(self, from: &[f32]) -> float32x4_t {
        assert!(from.len() >= 4);
        // SAFETY: as above; 4 numbers are there.
        unsafe { vld1q_f32(from.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, x: float32x4_t, to: &mut [f32]) {
        assert!(to.len() >= 4);
        // SAFETY: as above; there is room for 4 numbers.
        unsafe { vst1q_f32(to.as_mut_ptr(), x) }
    }
    #[inline(always)]
    fn add(self, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vaddq_f32(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vsubq_f32(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vmulq_f32(a, b) }
    }
    #[inline(always)]
    fn mul_add(self, a: float32x4_t, b: float32x4_t, c: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vfmaq_f32(c, a, b) }
    }
    #[inline(always)]
    fn mul_sub(self, a: float32x4_t, b: float32x4_t, c: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vfmaq_f32(vnegq_f32(c), a, b) }
    }
    #[inline(always)]
    fn neg_mul_add(self, a: float32x4_t, b: float32x4_t, c: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe { vfmsq_f32(c, a, b) }
    }
    #[inline(always)]
    fn unzip(self, a: float32x4_t, b: float32x4_t) -> [float32x4_t; 2] {
        // SAFETY: as above.
        unsafe { [vuzp1q_f32(a, b), vuzp2q_f32(a, b)] }
    }
    #[inline(always)]
    fn zip(self, a: float32x4_t, b: float32x4_t) -> [float32x4_t; 2] {
        // SAFETY: as above.
        unsafe { [vzip1q_f32(a, b), vzip2q_f32(a, b)] }
    }
    #[inline(always)]
    fn is_equal(self, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        // SAFETY: as above.
        unsafe {
            let one = vreinterpretq_u32_f32(vdupq_n_f32(1.0));
            vreinterpretq_f32_u32(vandq_u32(vceqq_f32(a, b), one))
        }
    }
    #[inline(always)]
    fn ends(self, x: float32x4_t) -> [f32; 2] {
        // SAFETY: as above.
        unsafe { [vminvq_f32(x), vmaxvq_f32(x)] }
    }
    #[inline(always)]
    fn narrow(self, values: &[f32; 16]) -> uint8x16x4_t {
        self.table(values)
    }
    #[inline(always)]
    fn of_narrow(self, values: uint8x16x4_t, at: float32x4_t) -> float32x4_t {
        let at = self.bytes(at, 15);
        // SAFETY: as above.
        unsafe { vreinterpretq_f32_u8(vqtbl4q_u8(values, at)) }
    }
    #[inline(always)]
    fn wide(self, values: &[f32; 32]) -> [uint8x16x4_t; 2] {
        let (low, high) = values.split_at(16);
        [low, high].map(|half| self.table(half.try_into().expect("16 numbers")))
    }
    #[inline(always)]
    fn of_wide(self, [low, high]: [uint8x16x4_t; 2], at: float32x4_t) -> float32x4_t {
        let at = self.bytes(at, 31);
        // SAFETY: as above. Indices above 63 are outside the lower half, whose lookup gives 0
        // there; indices below 64, minus 64, are outside the upper half, whose lookup keeps the previous value.
        unsafe {
            let values = vqtbl4q_u8(low, at);
            let at = vsubq_u8(at, vdupq_n_u8(64));
            vreinterpretq_f32_u8(vqtbx4q_u8(values, high, at))
        }
    }
    #[inline(always)]
    fn short(self, values: &[f32; 8]) -> uint8x16x2_t {
        // SAFETY: as above; 32 bytes are 8 numbers.
        unsafe { vld1q_u8_x2(values.as_ptr().cast()) }
    }
    #[inline(always)]
    fn of_short(self, values: uint8x16x2_t, at: float32x4_t) -> float32x4_t {
        let at = self.bytes(at, 7);
        // SAFETY: as above.
        unsafe { vreinterpretq_f32_u8(vqtbl2q_u8(values, at)) }
    }
    #[inline(always)]
    fn quarter(self, values: &[f32; 4]) -> uint8x16_t {
        // SAFETY: as above; 16 bytes are 4 numbers.
        unsafe { vld1q_u8(values.as_ptr().cast()) }
    }
    #[inline(always)]
    fn of_quarter(self, values: uint8x16_t, at: float32x4_t) -> float32x4_t {
        let at = self.bytes(at, 3);
        // SAFETY: as above.
        unsafe { vreinterpretq_f32_u8(vqtbl1q_u8(values, at)) }
    }
}
