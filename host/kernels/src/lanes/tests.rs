//! Each operation in all available instruction sets against scalar arithmetic, on numbers of every kind and at any
//! memory alignment.

use std::panic::catch_unwind;

use super::*;

/// Special values: zeros, limits of denormal and finite numbers, integers whose bit patterns are indices, infinities, NaN.
const SPECIAL: [f32; 22] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1.5,
    f32::EPSILON,
    1e-45,
    -1e-45,
    1.1754942e-38,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    1e-30,
    -3e-23,
    16_777_217.0,
    12_582_912.0,
    -12_582_919.0,
    1.8446744e19,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// Special values and random bit patterns, in many combinations over three slices.
fn numbers(seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut bits = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // The lowest bits of this generator are weak.
        (state >> 8) ^ state.rotate_left(13)
    };
    // Miri is a thousand times slower.
    let count = if cfg!(miri) { 320 } else { 4096 };
    (0..count)
        .map(|_| match bits() % 3 {
            0 => SPECIAL[bits() as usize % SPECIAL.len()],
            1 => f32::from_bits(bits()),
            _ => (bits() % 2001) as f32 / 1000.0 - 1.0,
        })
        .collect()
}

/// Equal bits, or both NaN (NaN payloads are unspecified).
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    Add,
    Sub,
    Mul,
    MulAdd,
    MulSub,
    NegMulAdd,
}

impl Operation {
    const ALL: [Self; 6] = [
        Self::Add,
        Self::Sub,
        Self::Mul,
        Self::MulAdd,
        Self::MulSub,
        Self::NegMulAdd,
    ];

    /// Scalar result, rounded once.
    fn of(self, a: f32, b: f32, c: f32) -> f32 {
        // Exact in float64.
        let product = f64::from(a) * f64::from(b);
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => product as f32,
            Self::MulAdd => rounded_sum(product, c),
            Self::MulSub => rounded_sum(product, -c),
            Self::NegMulAdd => rounded_sum(-product, c),
        }
    }
}

/// `a + b` rounded once: float64 rounded to odd, then to float32, equals the correctly rounded
/// sum, because float64 has more than two extra bits.
fn rounded_sum(a: f64, b: f32) -> f32 {
    let b = f64::from(b);
    let sum = a + b;
    // Exact rounding error (Knuth's two-sum).
    let of_b = sum - a;
    let left_out = (a - (sum - of_b)) + (b - of_b);
    if !sum.is_finite() || left_out == 0.0 || sum.to_bits() % 2 == 1 {
        return sum as f32;
    }
    let away = (left_out > 0.0) == (sum > 0.0);
    let odd = if away {
        sum.to_bits() + 1
    } else {
        sum.to_bits() - 1
    };
    f64::from_bits(odd) as f32
}

/// Load, operation, store at an offset of `shift` numbers, for any alignment.
struct Each<'a> {
    operation: Operation,
    from: [&'a [f32]; 3],
    shift: usize,
}

impl Kernel for Each<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Vec<f32> {
        let [a, b, c] = self.from.map(|from| &from[self.shift..]);
        let count = a.len() - a.len() % L::COUNT;
        // Other elements must not be written.
        let mut all = vec![7.0; self.shift + count + 1];
        for i in (0..count).step_by(L::COUNT) {
            let to = &mut all[self.shift + i..self.shift + i + L::COUNT];
            let (a, b, c) = (
                lanes.load(&a[i..]),
                lanes.load(&b[i..]),
                lanes.load(&c[i..]),
            );
            let result = match self.operation {
                Operation::Add => lanes.add(a, b),
                Operation::Sub => lanes.sub(a, b),
                Operation::Mul => lanes.mul(a, b),
                Operation::MulAdd => lanes.mul_add(a, b, c),
                Operation::MulSub => lanes.mul_sub(a, b, c),
                Operation::NegMulAdd => lanes.neg_mul_add(a, b, c),
            };
            lanes.store(result, to);
        }
        assert!(all[..self.shift].iter().all(|x| *x == 7.0));
        assert_eq!(all.pop(), Some(7.0));
        all.split_off(self.shift)
    }
}

#[test]
fn vector_arithmetic_equals_scalar_arithmetic() {
    let [a, b, c] = [1, 2, 3].map(numbers);
    for instructions in all() {
        for operation in Operation::ALL {
            for shift in 0..5 {
                let from = [a.as_slice(), &b, &c];
                let got = instructions.run(Each {
                    operation,
                    from,
                    shift,
                });
                assert!(got.len() + shift + GROUP > a.len());
                for (i, got) in got.into_iter().enumerate().map(|(i, got)| (i + shift, got)) {
                    let expected = operation.of(a[i], b[i], c[i]);
                    assert!(
                        same(got, expected),
                        "{instructions:?} {operation:?} of {:?}, {:?}, {:?}: {got:?}, not {expected:?}",
                        a[i],
                        b[i],
                        c[i]
                    );
                }
            }
        }
    }
}

/// Data movement, which must keep all bits, NaN payloads included.
struct Moved<'a> {
    numbers: &'a [f32],
    values: &'a [f32; 32],
}

impl Kernel for Moved<'_> {
    type Output = [Vec<f32>; 7];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [Vec<f32>; 7] {
        let mut moved: [Vec<f32>; 7] = Default::default();
        let narrow = lanes.narrow(self.values[5..21].try_into().expect("16 values"));
        let wide = lanes.wide(self.values);
        let short = lanes.short(self.values[3..11].try_into().expect("8 values"));
        let quarter = lanes.quarter(self.values[7..11].try_into().expect("4 values"));
        for pair in self.numbers.chunks_exact(2 * GROUP) {
            let [mut even, mut odd] = [[0.0; GROUP]; 2];
            for i in (0..GROUP).step_by(L::COUNT) {
                let first = lanes.load(&pair[2 * i..]);
                let [e, o] = lanes.unzip(first, lanes.load(&pair[2 * i + L::COUNT..]));
                lanes.store(e, &mut even[i..]);
                lanes.store(o, &mut odd[i..]);
            }
            moved[0].extend(even);
            moved[1].extend(odd);
        }
        for part in self.numbers.chunks_exact(GROUP) {
            let [mut of_narrow, mut of_wide, mut splat] = [[0.0; GROUP]; 3];
            let [mut of_short, mut of_quarter] = [[0.0; GROUP]; 2];
            for i in (0..GROUP).step_by(L::COUNT) {
                let at = lanes.load(&part[i..]);
                lanes.store(lanes.of_narrow(narrow, at), &mut of_narrow[i..]);
                lanes.store(lanes.of_wide(wide, at), &mut of_wide[i..]);
                lanes.store(lanes.splat(part[0]), &mut splat[i..]);
                lanes.store(lanes.of_short(short, at), &mut of_short[i..]);
                lanes.store(lanes.of_quarter(quarter, at), &mut of_quarter[i..]);
            }
            moved[2].extend(of_narrow);
            moved[3].extend(of_wide);
            moved[4].extend(splat);
            moved[5].extend(of_short);
            moved[6].extend(of_quarter);
        }
        moved
    }
}

#[test]
fn data_movement_is_bit_exact() {
    let (places, values) = (numbers(4), numbers(5));
    let values: &[f32; 32] = values[..32].try_into().unwrap();
    let at = |count: u32, from: usize| {
        let places = places.iter();
        places
            .map(|place| values[from + (place.to_bits() % count) as usize])
            .collect::<Vec<_>>()
    };
    let halves = [0, 1].map(|first| places.iter().copied().skip(first).step_by(2).collect());
    let [even, odd]: [Vec<f32>; 2] = halves;
    let splat = (0..places.len()).map(|i| places[i - i % GROUP]).collect();
    let expected = [even, odd, at(16, 5), at(32, 0), splat, at(8, 3), at(4, 7)];
    let bits = |all: &Vec<f32>| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    for instructions in all() {
        let got = instructions.run(Moved {
            numbers: &places,
            values,
        });
        for (what, (got, expected)) in got.iter().zip(&expected).enumerate() {
            assert!(bits(got) == bits(expected), "{instructions:?} {what}");
        }
    }
}

/// Interleaved pairs, comparison with the next number, ends of each vector, and tiles transposed.
struct Arranged<'a>(&'a [f32]);

impl Kernel for Arranged<'_> {
    type Output = [Vec<f32>; 4];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [Vec<f32>; 4] {
        let [mut zipped, mut equal, mut ends, mut tiles] = [const { Vec::new() }; 4];
        for (i, part) in self.0.chunks_exact(2 * GROUP).enumerate() {
            let (a, b) = part.split_at(GROUP);
            for at in (0..GROUP).step_by(L::COUNT) {
                let (a, b) = (lanes.load(&a[at..]), lanes.load(&b[at..]));
                let mut own = [0.0; 2 * GROUP];
                let [first, last] = lanes.zip(a, b);
                lanes.store(first, &mut own);
                lanes.store(last, &mut own[L::COUNT..]);
                zipped.extend(&own[..2 * L::COUNT]);
                lanes.store(lanes.is_equal(a, b), &mut own);
                equal.extend(&own[..L::COUNT]);
                ends.extend(lanes.ends(a));
            }
            let mut tile = [lanes.splat(0.0); GROUP];
            for (row, tile) in tile.iter_mut().enumerate().take(L::COUNT) {
                let numbers: [f32; GROUP] = std::array::from_fn(|lane| tile_number(i, row, lane));
                *tile = lanes.load(&numbers);
            }
            transpose(lanes, &mut tile);
            for (row, &tile) in tile.iter().enumerate().take(L::COUNT) {
                let mut own = [0.0; GROUP];
                lanes.store(tile, &mut own);
                let expected = (0..L::COUNT).map(|lane| tile_number(i, lane, row));
                tiles.extend(
                    own.iter()
                        .zip(expected)
                        .map(|(got, expected)| got - expected),
                );
            }
        }
        [zipped, equal, ends, tiles]
    }
}

fn tile_number(tile: usize, row: usize, lane: usize) -> f32 {
    (tile * 1000 + row * 20 + lane) as f32
}

#[test]
fn arrangement_and_comparison_equal_scalar_operations() {
    let finite = |seed| {
        numbers(seed)
            .into_iter()
            .map(|x| if x.is_finite() { x } else { 2.0 })
    };
    let numbers: Vec<f32> = finite(8).map(|x| (4.0 * x).round() / 4.0).collect();
    for instructions in all() {
        let [zipped, equal, ends, tiles] = instructions.run(Arranged(&numbers));
        let pairs = numbers.chunks_exact(2 * GROUP).flat_map(|part| {
            let (a, b) = part.split_at(GROUP);
            a.iter().zip(b)
        });
        for (i, (a, b)) in pairs.enumerate() {
            assert!(same(zipped[2 * i], *a) && same(zipped[2 * i + 1], *b));
            assert_eq!(equal[i], if a == b { 1.0 } else { 0.0 });
        }
        let count = equal.len() / (ends.len() / 2);
        let first_halves = numbers
            .chunks_exact(2 * GROUP)
            .flat_map(|part| &part[..GROUP]);
        let first_halves: Vec<f32> = first_halves.copied().collect();
        for (part, ends) in first_halves
            .chunks_exact(count)
            .zip(ends.as_chunks::<2>().0)
        {
            let least = part.iter().copied().fold(f32::INFINITY, f32::min);
            let most = part.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            assert_eq!(*ends, [least, most]);
        }
        assert!(equal.contains(&1.0) && equal.contains(&0.0));
        assert!(!tiles.is_empty() && tiles.iter().all(|off| *off == 0.0));
    }
}

/// Load or store with a slice that is one number too short.
struct TooFew {
    is_read: bool,
}

impl Kernel for TooFew {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let mut room = [0.0; GROUP];
        let room = &mut room[..L::COUNT - 1];
        match self.is_read {
            true => _ = std::hint::black_box(lanes.load(room)),
            false => lanes.store(lanes.splat(1.0), room),
        }
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "a panic ends the module")]
fn short_slice_panics_without_access_beyond_it() {
    for instructions in all() {
        for is_read in [true, false] {
            let done = catch_unwind(|| instructions.run(TooFew { is_read }));
            assert!(done.is_err(), "{instructions:?} {is_read}");
        }
    }
}

/// Available instruction sets; prints those of this architecture that are missing.
fn all() -> Vec<Instructions> {
    let available = Instructions::available();
    #[cfg(target_arch = "x86_64")]
    let known = [Instructions::Avx2, Instructions::Avx512];
    #[cfg(target_arch = "aarch64")]
    let known = [Instructions::Neon];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let known: [Instructions; 0] = [];
    for instructions in known {
        if !available.contains(&instructions) {
            println!(
                "skipped: kernels in {}: not available on this processor",
                instructions.name()
            );
        }
    }
    available
}
