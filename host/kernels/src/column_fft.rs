//! Inverse Fourier transforms of [`GROUP`] columns at once, one column per lane.
//!
//! ```text
//! X[k] = sum_n x[n] exp(+j 2 pi k n / N)
//! ```
//!
//! Unnormalised mixed-radix transforms in the autosort form of Stockham (decimation in frequency), with factors 4, 2, 3 and 5. Rows are
//! elements of the transform and columns are independent, so that every operation is a vector operation without shuffles, and the
//! result is bit-identical in all instruction sets.
//!
//! **Accuracy** float32 with fused operations: about 1e-7 RMS relative to the RMS of the output for each doubling of the length.
//! **Cost** `N log2(N)` times 4 to 5 real operations per column, and one pass over the rows for each factor.

use std::f64::consts::TAU;

use crate::lanes::{GROUP, Lanes};

/// One row of a block of columns: real parts, then imaginary parts.
pub(crate) type Row = [f32; 2 * GROUP];

/// Row with all values zero.
pub(crate) const ZEROS: Row = [0.0; 2 * GROUP];

/// Plan of a transform.
#[derive(Clone, Debug)]
pub struct ColumnFft {
    length: usize,
    stages: Vec<Stage>,
}

/// One factor of the length.
#[derive(Clone, Debug)]
struct Stage {
    radix: usize,
    /// Rows from one input of a butterfly to the next.
    apart: usize,
    /// Adjacent rows with equal twiddle factors.
    equal: usize,
    /// Twiddle factors of outputs 1 to `radix - 1`, for each butterfly.
    twiddles: Vec<[f32; 2]>,
}

impl ColumnFft {
    /// Plan a transform of `length` rows.
    ///
    /// # Panics
    /// If the length is 0 or has a prime factor above 5 ([`subaperture_signal::fast_length`] has none).
    pub fn new(length: usize) -> Self {
        assert!(length > 0);
        let (mut rest, mut equal) = (length, 1);
        let mut stages = Vec::new();
        while rest > 1 {
            let radix = [4, 2, 3, 5].into_iter().find(|&r| rest.is_multiple_of(r));
            let radix = radix.expect("expected a length of factors 2, 3 and 5");
            let butterflies = rest / radix;
            let twiddle = |p: usize, j: usize| {
                let (sin, cos) = libm::sincos(TAU * (p * j % rest) as f64 / rest as f64);
                [cos as f32, sin as f32]
            };
            stages.push(Stage {
                radix,
                apart: butterflies * equal,
                equal,
                twiddles: (0..butterflies)
                    .flat_map(|p| (1..radix).map(move |j| (p, j)))
                    .map(|(p, j)| twiddle(p, j))
                    .collect(),
            });
            rest = butterflies;
            equal *= radix;
        }
        Self { length, stages }
    }

    /// Number of rows of the transform.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Whether the transform has no rows; never.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Transform `rows`, with `other` of the same length as scratch; the result is in the returned slice.
    #[inline(always)]
    pub(crate) fn run<'a, L: Lanes>(
        &self,
        lanes: L,
        rows: &'a mut [Row],
        other: &'a mut [Row],
    ) -> &'a mut [Row] {
        assert!(rows.len() == self.length && other.len() == self.length);
        let (mut from, mut to) = (rows, other);
        for stage in &self.stages {
            match stage.radix {
                2 => stage.run::<L, 2>(lanes, from, to),
                3 => stage.run::<L, 3>(lanes, from, to),
                4 => stage.run::<L, 4>(lanes, from, to),
                _ => stage.run::<L, 5>(lanes, from, to),
            }
            (from, to) = (to, from);
        }
        from
    }
}

impl Stage {
    #[inline(always)]
    fn run<L: Lanes, const R: usize>(&self, lanes: L, from: &[Row], to: &mut [Row]) {
        let Self { apart, equal, .. } = *self;
        let butterflies = apart / equal;
        for p in 0..butterflies {
            let twiddles = &self.twiddles[p * (R - 1)..(p + 1) * (R - 1)];
            for q in 0..equal {
                for part in (0..GROUP).step_by(L::COUNT) {
                    let mut x = [[lanes.splat(0.0); 2]; R];
                    for (k, x) in x.iter_mut().enumerate() {
                        let row = &from[q + equal * p + apart * k];
                        *x = [lanes.load(&row[part..]), lanes.load(&row[GROUP + part..])];
                    }
                    let y = butterfly(lanes, x);
                    for (j, &y) in y.iter().enumerate() {
                        let row = &mut to[q + equal * (R * p + j)];
                        let [re, im] = match j > 0 && p > 0 {
                            true => {
                                let [cos, sin] = twiddles[j - 1];
                                let (cos, sin) = (lanes.splat(cos), lanes.splat(sin));
                                [
                                    lanes.neg_mul_add(y[1], sin, lanes.mul(y[0], cos)),
                                    lanes.mul_add(y[1], cos, lanes.mul(y[0], sin)),
                                ]
                            }
                            false => y,
                        };
                        lanes.store(re, &mut row[part..]);
                        lanes.store(im, &mut row[GROUP + part..]);
                    }
                }
            }
        }
    }
}

/// Real and imaginary parts of a vector of lanes.
type Pair<L> = [<L as Lanes>::Numbers; 2];

#[inline(always)]
fn add<L: Lanes>(lanes: L, a: Pair<L>, b: Pair<L>) -> Pair<L> {
    [lanes.add(a[0], b[0]), lanes.add(a[1], b[1])]
}

#[inline(always)]
fn sub<L: Lanes>(lanes: L, a: Pair<L>, b: Pair<L>) -> Pair<L> {
    [lanes.sub(a[0], b[0]), lanes.sub(a[1], b[1])]
}

#[inline(always)]
fn times<L: Lanes>(lanes: L, a: Pair<L>, factor: f32) -> Pair<L> {
    let factor = lanes.splat(factor);
    [lanes.mul(a[0], factor), lanes.mul(a[1], factor)]
}

/// `c + factor a`.
#[inline(always)]
fn add_times<L: Lanes>(lanes: L, c: Pair<L>, a: Pair<L>, factor: f32) -> Pair<L> {
    let factor = lanes.splat(factor);
    [
        lanes.mul_add(a[0], factor, c[0]),
        lanes.mul_add(a[1], factor, c[1]),
    ]
}

/// `a + j b` and `a - j b`.
#[inline(always)]
fn quarter_turns<L: Lanes>(lanes: L, a: Pair<L>, b: Pair<L>) -> [Pair<L>; 2] {
    [
        [lanes.sub(a[0], b[1]), lanes.add(a[1], b[0])],
        [lanes.add(a[0], b[1]), lanes.sub(a[1], b[0])],
    ]
}

/// Transform of `R` elements.
#[inline(always)]
fn butterfly<L: Lanes, const R: usize>(lanes: L, x: [Pair<L>; R]) -> [Pair<L>; R] {
    let mut y = x;
    match R {
        2 => {
            y[0] = add(lanes, x[0], x[1]);
            y[1] = sub(lanes, x[0], x[1]);
        }
        3 => {
            const SIN: f32 = 0.866_025_4;
            let sum = add(lanes, x[1], x[2]);
            let off = times(lanes, sub(lanes, x[1], x[2]), SIN);
            y[0] = add(lanes, x[0], sum);
            [y[1], y[2]] = quarter_turns(lanes, add_times(lanes, x[0], sum, -0.5), off);
        }
        4 => {
            let (even, odd) = (add(lanes, x[0], x[2]), add(lanes, x[1], x[3]));
            y[0] = add(lanes, even, odd);
            y[2] = sub(lanes, even, odd);
            let (even, odd) = (sub(lanes, x[0], x[2]), sub(lanes, x[1], x[3]));
            [y[1], y[3]] = quarter_turns(lanes, even, odd);
        }
        _ => {
            // Cosine and sine of a fifth and of two fifths of a turn.
            const COS: [f32; 2] = [0.309_017, -0.809_017];
            const SIN: [f32; 2] = [0.951_056_5, 0.587_785_25];
            let (near, far) = (add(lanes, x[1], x[4]), add(lanes, x[2], x[3]));
            let (near_off, far_off) = (sub(lanes, x[1], x[4]), sub(lanes, x[2], x[3]));
            y[0] = add(lanes, add(lanes, x[0], near), far);
            let first = add_times(lanes, add_times(lanes, x[0], near, COS[0]), far, COS[1]);
            let first_off = add_times(lanes, times(lanes, near_off, SIN[0]), far_off, SIN[1]);
            [y[1], y[4]] = quarter_turns(lanes, first, first_off);
            let second = add_times(lanes, add_times(lanes, x[0], near, COS[1]), far, COS[0]);
            let second_off = add_times(lanes, times(lanes, near_off, SIN[1]), far_off, -SIN[0]);
            [y[2], y[3]] = quarter_turns(lanes, second, second_off);
        }
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Instructions, Kernel};
    use crate::trial::{Numbers, turned, wide};
    use num_complex::{Complex32, Complex64};

    struct Transform<'a> {
        fft: &'a ColumnFft,
        rows: Vec<Row>,
    }

    impl Kernel for Transform<'_> {
        type Output = Vec<Row>;

        #[inline(always)]
        fn run<L: Lanes>(mut self, lanes: L) -> Vec<Row> {
            let mut other = vec![ZEROS; self.rows.len()];
            self.fft.run(lanes, &mut self.rows, &mut other).to_vec()
        }
    }

    #[test]
    fn columns_agree_with_defining_sum() {
        let mut numbers = Numbers::new(5);
        for length in [1, 2, 3, 4, 5, 6, 15, 16, 60, 90, 128, 200] {
            let fft = ColumnFft::new(length);
            assert!(fft.len() == length && !fft.is_empty());
            let columns: Vec<Vec<Complex32>> =
                (0..GROUP).map(|_| numbers.samples(length)).collect();
            let mut rows = vec![ZEROS; length];
            for (i, column) in columns.iter().enumerate() {
                for (row, z) in rows.iter_mut().zip(column) {
                    (row[i], row[GROUP + i]) = (z.re, z.im);
                }
            }
            let of = |instructions: Instructions| {
                let rows = rows.clone();
                instructions.run(Transform { fft: &fft, rows })
            };
            let portable = of(Instructions::Portable);
            for instructions in Instructions::available() {
                assert_eq!(of(instructions), portable, "{instructions:?} {length}");
            }
            for (i, column) in columns.iter().enumerate() {
                let power: f64 = column.iter().map(|&z| wide(z).norm_sqr()).sum();
                for (k, row) in portable.iter().enumerate() {
                    let turns = |n: usize| (k * n % length) as f64 / length as f64;
                    let terms = column.iter().enumerate();
                    let expected: Complex64 = terms.map(|(n, &z)| wide(z) * turned(turns(n))).sum();
                    let got = Complex64::new(row[i].into(), row[GROUP + i].into());
                    // Some six roundings of 6e-8 for each factor, of terms of this power.
                    let allowed = 3e-7 * power.sqrt() * (2.0 + (length as f64).log2());
                    assert!((got - expected).norm() < allowed, "{length} {k}");
                }
            }
        }
    }
}
