//! Sum of a pulse's samples at many delays in float32, from even and odd parts of blocks of samples.
//!
//! ```text
//! sum[i] = sum_k w[k] z[k] exp(j 2 pi turns[i] k)
//! ```
//!
//! A block of `2 J` samples is referred to its centre. The samples at distance `d = 1/2, 3/2, ...` after and before the centre have
//! conjugate phasors, so with the even part `a = z(d) + z(-d)` and the odd part `b = z(d) - z(-d)` the sum of the block is
//!
//! ```text
//! sum_d a cos(2 pi turns d) + j b sin(2 pi turns d)
//! ```
//!
//! A product of a complex and a real number per sample replaces a complex product. The parts are the same for all delays, and the
//! cosines and sines for all blocks. Blocks are joined in float64 by Horner's rule, from the first to the last: memory is read in ascending
//! order.
//!
//! **Accuracy** Products of a block are float32 with fused operations: relative RMS error below [`RMS`]. The order is fixed, and the
//! result is bit-identical in all instruction sets. **Cost** 4 operations per sample and delay.

use num_complex::{Complex32, Complex64};

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::phasor::phasors;

/// Number of delays evaluated together.
pub const TOGETHER: usize = 4 * GROUP;
/// Relative RMS error, for samples that add with random phase.
pub const RMS: f64 = 4e-7;

/// Half the samples of a block.
const HALF: usize = 32;
/// Vectors of delays summed together, to hide the latency of a sum.
const VECTORS: usize = 4;

/// Sum weighted `samples` for each phase step in `turns` per sample.
///
/// # Panics
/// If the numbers of weights and samples differ.
pub fn folded_sums(
    instructions: Instructions,
    samples: &[Complex32],
    weights: &[f32],
    turns: &[f64; TOGETHER],
) -> [Complex64; TOGETHER] {
    assert_eq!(samples.len(), weights.len());
    // Half a step: the distance of the innermost samples from the centre of a block.
    let mut halves = [Complex64::ZERO; TOGETHER];
    phasors(instructions, &turns.map(|turns| 0.5 * turns), &mut halves);
    instructions.run(FoldedSums {
        samples,
        weights,
        halves: &halves,
    })
}

struct FoldedSums<'a> {
    samples: &'a [Complex32],
    weights: &'a [f32],
    halves: &'a [Complex64; TOGETHER],
}

/// Float64 complex numbers of all delays, real and imaginary parts apart.
#[derive(Clone, Copy)]
struct Wide {
    re: [f64; TOGETHER],
    im: [f64; TOGETHER],
}

impl Wide {
    const ZERO: Self = Self {
        re: [0.0; TOGETHER],
        im: [0.0; TOGETHER],
    };

    /// Multiply by other numbers.
    #[inline(always)]
    fn multiply(&mut self, by: &Self) {
        for i in 0..TOGETHER {
            let (a, b) = (self.re[i], self.im[i]);
            self.re[i] = a * by.re[i] - b * by.im[i];
            self.im[i] = a * by.im[i] + b * by.re[i];
        }
    }
}

/// Even and odd parts of a block, by distance from its centre.
#[derive(Default)]
struct Parts {
    even_re: [f32; HALF],
    even_im: [f32; HALF],
    odd_re: [f32; HALF],
    odd_im: [f32; HALF],
}

impl Parts {
    /// Parts of a block that is followed by zeros.
    #[inline(always)]
    fn set(&mut self, samples: &[Complex32], weights: &[f32]) {
        let [mut re, mut im] = [[0.0f32; 2 * HALF]; 2];
        for (i, (z, w)) in samples.iter().zip(weights).enumerate() {
            (re[i], im[i]) = (z.re * w, z.im * w);
        }
        for d in 0..HALF {
            let (after, before) = (HALF + d, HALF - 1 - d);
            self.even_re[d] = re[after] + re[before];
            self.even_im[d] = im[after] + im[before];
            self.odd_re[d] = re[after] - re[before];
            self.odd_im[d] = im[after] - im[before];
        }
    }
}

impl Kernel for FoldedSums<'_> {
    type Output = [Complex64; TOGETHER];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Output {
        const N: usize = TOGETHER;
        let [mut cos, mut sin] = [[[0.0f32; N]; HALF]; 2];
        let mut power = Wide::ZERO;
        for (i, half) in self.halves.iter().enumerate() {
            (power.re[i], power.im[i]) = (half.re, half.im);
        }
        let mut step = power;
        step.multiply(&power);
        for d in 0..HALF {
            if d > 0 {
                power.multiply(&step);
            }
            for i in 0..N {
                (cos[d][i], sin[d][i]) = (power.re[i] as f32, power.im[i] as f32);
            }
        }
        // The centre of the first block is at sample `HALF - 1/2`.
        let mut centre = power;
        for _ in 0..(2 * HALF).ilog2() {
            let same = step;
            step.multiply(&same);
        }
        let mut back = step;
        for im in &mut back.im {
            *im = -*im;
        }
        let [mut run_re, mut run_im] = [[0.0f32; N]; 2];
        let mut sums = Wide::ZERO;
        let mut parts = Parts::default();
        let blocks = (self.samples.chunks(2 * HALF)).zip(self.weights.chunks(2 * HALF));
        for (samples, weights) in blocks {
            parts.set(samples, weights);
            for from in (0..N).step_by(VECTORS * L::COUNT) {
                let [mut re, mut im] = [[lanes.splat(0.0); VECTORS]; 2];
                for d in 0..HALF {
                    let (even_re, even_im) =
                        (lanes.splat(parts.even_re[d]), lanes.splat(parts.even_im[d]));
                    let (odd_re, odd_im) =
                        (lanes.splat(parts.odd_re[d]), lanes.splat(parts.odd_im[d]));
                    for v in 0..VECTORS {
                        let cos = lanes.load(&cos[d][from + v * L::COUNT..]);
                        let sin = lanes.load(&sin[d][from + v * L::COUNT..]);
                        re[v] = lanes.mul_add(even_re, cos, re[v]);
                        im[v] = lanes.mul_add(even_im, cos, im[v]);
                        re[v] = lanes.neg_mul_add(odd_im, sin, re[v]);
                        im[v] = lanes.mul_add(odd_re, sin, im[v]);
                    }
                }
                for v in 0..VECTORS {
                    lanes.store(re[v], &mut run_re[from + v * L::COUNT..]);
                    lanes.store(im[v], &mut run_im[from + v * L::COUNT..]);
                }
            }
            sums.multiply(&back);
            for i in 0..N {
                sums.re[i] += f64::from(run_re[i]);
                sums.im[i] += f64::from(run_im[i]);
            }
        }
        // The sum is referred to the centre of the last block.
        let mut last = self.samples.len().saturating_sub(1) / (2 * HALF);
        while last > 0 {
            if last % 2 == 1 {
                centre.multiply(&step);
            }
            let same = step;
            step.multiply(&same);
            last /= 2;
        }
        sums.multiply(&centre);
        let mut all = [Complex64::ZERO; N];
        for (i, sum) in all.iter_mut().enumerate() {
            *sum = Complex64::new(sums.re[i], sums.im[i]);
        }
        all
    }
}
