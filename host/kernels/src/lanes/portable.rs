//! Portable lanes in plain Rust, the test oracle of the others.

use super::Lanes;

const COUNT: usize = 4;

/// Baseline instructions.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

#[inline(always)]
fn each(of: impl FnMut(usize) -> f32) -> [f32; COUNT] {
    std::array::from_fn(of)
}

impl Lanes for Portable {
    type Numbers = [f32; COUNT];
    type Narrow = [f32; 16];
    type Wide = [f32; 32];
    type Short = [f32; 8];
    type Quarter = [f32; 4];
    const COUNT: usize = COUNT;
    const LOOKS_UP: bool = false;

    #[inline(always)]
    fn splat(self, x: f32) -> Self::Numbers {
        [x; COUNT]
    }
    #[inline(always)]
    fn load(self, from: &[f32]) -> Self::Numbers {
        each(|i| from[i])
    }
    #[inline(always)]
    fn store(self, x: Self::Numbers, to: &mut [f32]) {
        to[..COUNT].copy_from_slice(&x);
    }
    #[inline(always)]
    fn add(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        each(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        each(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        each(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers {
        each(|i| a[i].mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn mul_sub(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers {
        each(|i| a[i].mul_add(b[i], -c[i]))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self::Numbers, b: Self::Numbers, c: Self::Numbers) -> Self::Numbers {
        each(|i| (-a[i]).mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn unzip(self, a: Self::Numbers, b: Self::Numbers) -> [Self::Numbers; 2] {
        [[a[0], a[2], b[0], b[2]], [a[1], a[3], b[1], b[3]]]
    }
    #[inline(always)]
    fn zip(self, a: Self::Numbers, b: Self::Numbers) -> [Self::Numbers; 2] {
        [[a[0], b[0], a[1], b[1]], [a[2], b[2], a[3], b[3]]]
    }
    #[inline(always)]
    fn is_equal(self, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        each(|i| if a[i] == b[i] { 1.0 } else { 0.0 })
    }
    #[inline(always)]
    fn ends(self, x: Self::Numbers) -> [f32; 2] {
        let pick = |least: f32, x: f32| if x < least { x } else { least };
        let least = pick(pick(x[0], x[1]), pick(x[2], x[3]));
        let pick = |most: f32, x: f32| if x > most { x } else { most };
        [least, pick(pick(x[0], x[1]), pick(x[2], x[3]))]
    }
    #[inline(always)]
    fn narrow(self, values: &[f32; 16]) -> [f32; 16] {
        *values
    }
    #[inline(always)]
    fn of_narrow(self, values: [f32; 16], at: Self::Numbers) -> Self::Numbers {
        each(|i| values[(at[i].to_bits() & 15) as usize])
    }
    #[inline(always)]
    fn wide(self, values: &[f32; 32]) -> [f32; 32] {
        *values
    }
    #[inline(always)]
    fn of_wide(self, values: [f32; 32], at: Self::Numbers) -> Self::Numbers {
        each(|i| values[(at[i].to_bits() & 31) as usize])
    }
    #[inline(always)]
    fn short(self, values: &[f32; 8]) -> [f32; 8] {
        *values
    }
    #[inline(always)]
    fn of_short(self, values: [f32; 8], at: Self::Numbers) -> Self::Numbers {
        each(|i| values[(at[i].to_bits() & 7) as usize])
    }
    #[inline(always)]
    fn quarter(self, values: &[f32; 4]) -> [f32; 4] {
        *values
    }
    #[inline(always)]
    fn of_quarter(self, values: [f32; 4], at: Self::Numbers) -> Self::Numbers {
        each(|i| values[(at[i].to_bits() & 3) as usize])
    }
}
