//! SIMD lanes: portable vector operations on float32 with run-time selection of the instruction set.
//!
//! A kernel is written once, over `Lanes`, and compiled for each instruction set. Every operation is rounded once (IEEE 754), and
//! multiply-adds are fused (`Lanes::mul_add`), so that results are bit-identical in all of them. `Portable` is plain
//! Rust and the test oracle of the others.
//!
//! The processor is queried once, at run time ([`Instructions::best`]). A value of a lane type is created only
//! by that query, so that it proves that its instructions are available.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(not(all(
    target_arch = "wasm32",
    target_feature = "simd128",
    not(target_feature = "relaxed-simd"),
    not(test)
)))]
mod portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
#[cfg(test)]
mod tests;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
#[cfg(target_arch = "aarch64")]
pub(crate) use neon::Neon;
#[cfg(not(all(
    target_arch = "wasm32",
    target_feature = "simd128",
    not(target_feature = "relaxed-simd"),
    not(test)
)))]
pub(crate) use portable::Portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(crate) use simd128::Simd128;

/// Group size of kernels: a multiple of the lane count of every instruction set.
pub const GROUP: usize = 16;

/// Vector operations on `COUNT` float32 lanes.
pub(crate) trait Lanes: Copy {
    /// Vector of `COUNT` numbers.
    type Numbers: Copy;
    /// Lookup table of 16 values, in registers where possible.
    type Narrow: Copy;
    /// Lookup table of 32 values.
    type Wide: Copy;
    /// Lookup table of 8 values.
    type Short: Copy;
    /// Lookup table of 4 values.
    type Quarter: Copy;
    /// Number of lanes, a divisor of [`GROUP`].
    const COUNT: usize;
    /// Whether tables are in registers.
    const LOOKS_UP: bool = true;
    /// Whether lookup in 4 or 8 values per register is cheaper than in 16 for a whole [`GROUP`].
    const LIKES_SHORT: bool = false;

    /// Broadcast a number to all lanes.
    fn splat(self, x: f32) -> Self::Numbers;
    /// Load the first `COUNT` numbers of `from`.
    fn load(self, from: &[f32]) -> Self::Numbers;
    /// Store to the first `COUNT` numbers of `to`.
    fn store(self, x: Self::Numbers, to: &mut [f32]);
    /// Fetch the cache line of an element ahead of its use; no effect on values.
    fn prefetch<T>(self, _: &T) {}
    fn add(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn sub(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn mul(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// `a b - c`, rounded once.
    fn mul_sub(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// `c - a b`, rounded once.
    fn neg_mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// Deinterleave: even elements of `a` then `b`, and odd elements.
    fn unzip(self, a: Self::Numbers, b: Self::Numbers) -> [Self::Numbers; 2];
    /// Interleave: the first elements of `a` and `b` in turn, and the last elements.
    fn zip(self, a: Self::Numbers, b: Self::Numbers) -> [Self::Numbers; 2];
    /// 1 in lanes where `a` equals `b`, 0 elsewhere.
    fn is_equal(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// Smallest and largest lane of finite numbers.
    fn ends(self, x: Self::Numbers) -> [f32; 2];
    /// Load a table of 16 values.
    fn narrow(self, values: &[f32; 16]) -> Self::Narrow;
    /// Look up 16 values by the lowest 4 bits of each lane.
    fn of_narrow(self, values: Self::Narrow, at: Self::Numbers) -> Self::Numbers;
    /// Load a table of 32 values.
    fn wide(self, values: &[f32; 32]) -> Self::Wide;
    /// Look up 32 values by the lowest 5 bits of each lane.
    fn of_wide(self, values: Self::Wide, at: Self::Numbers) -> Self::Numbers;
    /// Load a table of 8 values.
    fn short(self, values: &[f32; 8]) -> Self::Short;
    /// Look up 8 values by the lowest 3 bits of each lane.
    fn of_short(self, values: Self::Short, at: Self::Numbers) -> Self::Numbers;
    /// Load a table of 4 values.
    fn quarter(self, values: &[f32; 4]) -> Self::Quarter;
    /// Look up 4 values by the lowest 2 bits of each lane.
    fn of_quarter(self, values: Self::Quarter, at: Self::Numbers) -> Self::Numbers;
}

/// Instruction set of compiled kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Instructions {
    /// Baseline instructions of the target. In WebAssembly with simd128 these are its vectors.
    Portable,
    /// AVX2 and FMA, 8 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 (F, BW, DQ and VL), 16 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// NEON, 4 lanes.
    #[cfg(target_arch = "aarch64")]
    Neon,
    /// WebAssembly's 128-bit instructions, 4 lanes, with products added in float64.
    #[cfg(all(
        target_arch = "wasm32",
        target_feature = "simd128",
        any(test, not(target_feature = "relaxed-simd"))
    ))]
    Simd128,
    /// The same with fused multiply-adds, where the machine has them.
    #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
    Simd128Fused,
}

impl Instructions {
    /// Instruction sets of this processor, [`Self::Portable`] first, the fastest last.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "some targets have no other instructions")]
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(Avx2::new().map(|_| Self::Avx2));
            all.extend(Avx512::new().map(|_| Self::Avx512));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(Neon::new().map(|_| Self::Neon));
        #[cfg(all(
            target_arch = "wasm32",
            target_feature = "simd128",
            any(test, not(target_feature = "relaxed-simd"))
        ))]
        all.push(Self::Simd128);
        #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
        all.extend(Simd128::<true>::new().map(|_| Self::Simd128Fused));
        all
    }

    /// Fastest instruction set of this processor.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if Avx512::new().is_some() {
            return Self::Avx512;
        } else if Avx2::new().is_some() {
            return Self::Avx2;
        }
        #[cfg(target_arch = "aarch64")]
        if Neon::new().is_some() {
            return Self::Neon;
        }
        #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
        if Simd128::<true>::new().is_some() {
            return Self::Simd128Fused;
        }
        #[cfg(all(
            target_arch = "wasm32",
            target_feature = "simd128",
            not(target_feature = "relaxed-simd")
        ))]
        return Self::Simd128;
        #[cfg(not(all(
            target_arch = "wasm32",
            target_feature = "simd128",
            not(target_feature = "relaxed-simd")
        )))]
        Self::Portable
    }

    /// Name in records.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            Self::Neon => "neon",
            #[cfg(all(
                target_arch = "wasm32",
                target_feature = "simd128",
                any(test, not(target_feature = "relaxed-simd"))
            ))]
            Self::Simd128 => "simd128",
            #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
            Self::Simd128Fused => "simd128-fused",
        }
    }
}

/// Computation written over [`Lanes`].
pub(crate) trait Kernel {
    /// Result type.
    type Output;
    /// Run the kernel. Must be `#[inline(always)]`, as everything it calls, to be compiled for the lanes' instructions.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

impl Instructions {
    /// Run `kernel` in these instructions, or portably where this processor lacks them.
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            #[cfg(not(all(
                target_arch = "wasm32",
                target_feature = "simd128",
                not(target_feature = "relaxed-simd"),
                not(test)
            )))]
            Self::Portable => kernel.run(Portable),
            #[cfg(all(
                target_arch = "wasm32",
                target_feature = "simd128",
                not(target_feature = "relaxed-simd"),
                not(test)
            ))]
            Self::Portable => Simd128::<false>::new().run(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => match Avx2::new() {
                Some(lanes) => lanes.run(kernel),
                None => kernel.run(Portable),
            },
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => match Avx512::new() {
                Some(lanes) => lanes.run(kernel),
                None => kernel.run(Portable),
            },
            #[cfg(target_arch = "aarch64")]
            Self::Neon => match Neon::new() {
                Some(lanes) => lanes.run(kernel),
                None => kernel.run(Portable),
            },
            #[cfg(all(
                target_arch = "wasm32",
                target_feature = "simd128",
                any(test, not(target_feature = "relaxed-simd"))
            ))]
            Self::Simd128 => Simd128::<false>::new().run(kernel),
            #[cfg(all(target_arch = "wasm32", target_feature = "relaxed-simd"))]
            Self::Simd128Fused => match Simd128::<true>::new() {
                Some(lanes) => lanes.run(kernel),
                None => kernel.run(Portable),
            },
        }
    }
}

/// Transpose `COUNT` vectors of `COUNT` lanes, the first of `rows`: each step of perfect shuffles rotates the bits of row and lane by one.
#[inline(always)]
pub(crate) fn transpose<L: Lanes>(lanes: L, rows: &mut [L::Numbers; GROUP]) {
    let half = L::COUNT / 2;
    let mut step = 1;
    while step < L::COUNT {
        let from = *rows;
        for i in 0..half {
            [rows[2 * i], rows[2 * i + 1]] = lanes.zip(from[i], from[i + half]);
        }
        step *= 2;
    }
}
