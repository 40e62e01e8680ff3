//! Some float32 numbers at once, in the instructions that a processor has.
//!
//! A kernel is written once, over `Lanes`, and compiled for each: with every operation rounded once, as IEEE 754 says, and
//! products added without rounding between (`Lanes::mul_add`), its result is the same bits in all of them. `Portable` is plain
//! Rust and the oracle of the others.
//!
//! What a processor has is asked once, at run time ([`Instructions::best`]); a value of a type in here that needs more than the
//! least is made nowhere else, and so is itself the proof that its instructions are there.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
#[cfg(test)]
mod tests;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
#[cfg(target_arch = "aarch64")]
pub(crate) use neon::Neon;
pub(crate) use portable::Portable;

/// Numbers that kernels work on together, whatever the instructions: a multiple of what any of them takes.
pub const GROUP: usize = 16;

/// `COUNT` float32 numbers at once.
pub(crate) trait Lanes: Copy {
    /// Such numbers.
    type Numbers: Copy;
    /// 16 values that are looked up, in registers if there are so many.
    type Narrow: Copy;
    /// 32 of them.
    type Wide: Copy;
    /// 8 of them.
    type Short: Copy;
    /// 4 of them.
    type Quarter: Copy;
    /// How many: a divisor of [`GROUP`].
    const COUNT: usize;
    /// Whether values are looked up in registers.
    const LOOKS_UP: bool = true;
    /// Whether 4 or 8 values for the lanes of one register are looked up with less work than 16 for all of a [`GROUP`].
    const LIKES_SHORT: bool = false;

    /// The same number in all lanes.
    fn splat(self, x: f32) -> Self::Numbers;
    /// The first `COUNT` of `from`.
    fn load(self, from: &[f32]) -> Self::Numbers;
    /// Into the first `COUNT` of `to`.
    fn store(self, x: Self::Numbers, to: &mut [f32]);
    fn add(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn sub(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn mul(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// `a b - c`, rounded once.
    fn mul_sub(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// `c - a b`, rounded once.
    fn neg_mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers;
    /// The numbers at even places of `a` and then `b`, and those at odd places.
    fn unzip(self, a: Self::Numbers, b: Self::Numbers) -> [Self::Numbers; 2];
    /// 16 values, ready to be looked up.
    fn narrow(self, values: &[f32; 16]) -> Self::Narrow;
    /// Of 16 values those that the lowest 4 bits of each lane's pattern count to.
    fn of_narrow(self, values: Self::Narrow, at: Self::Numbers) -> Self::Numbers;
    /// 32 values, ready to be looked up.
    fn wide(self, values: &[f32; 32]) -> Self::Wide;
    /// Of 32 values those that the lowest 5 bits of each lane's pattern count to.
    fn of_wide(self, values: Self::Wide, at: Self::Numbers) -> Self::Numbers;
    /// 8 values, ready to be looked up.
    fn short(self, values: &[f32; 8]) -> Self::Short;
    /// Of 8 values those that the lowest 3 bits of each lane's pattern count to.
    fn of_short(self, values: Self::Short, at: Self::Numbers) -> Self::Numbers;
    /// 4 values, ready to be looked up.
    fn quarter(self, values: &[f32; 4]) -> Self::Quarter;
    /// Of 4 values those that the lowest 2 bits of each lane's pattern count to.
    fn of_quarter(self, values: Self::Quarter, at: Self::Numbers) -> Self::Numbers;
}

/// A set of instructions that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Instructions {
    /// Those that every processor has.
    Portable,
    /// AVX2 and FMA, 8 numbers at once.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 (F, BW, DQ and VL), 16 numbers at once.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// NEON, 4 numbers at once.
    #[cfg(target_arch = "aarch64")]
    Neon,
}

impl Instructions {
    /// All that this processor has, [`Self::Portable`] first and the fastest last.
    pub fn available() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(Avx2::new().map(|_| Self::Avx2));
            all.extend(Avx512::new().map(|_| Self::Avx512));
        }
        #[cfg(target_arch = "aarch64")]
        all.extend(Neon::new().map(|_| Self::Neon));
        all
    }

    /// The fastest that this processor has.
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
        Self::Portable
    }

    /// The name used in records.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            Self::Neon => "neon",
        }
    }
}

/// Work that is written over [`Lanes`] and done in any of them.
pub(crate) trait Kernel {
    /// What comes of it.
    type Output;
    /// Does it. To be marked `#[inline(always)]`, as all that it calls: only then is it compiled in the instructions of the lanes.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

impl Instructions {
    /// Does `kernel` in these instructions; portably, where this processor has not got them.
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Portable => kernel.run(Portable),
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
        }
    }
}
