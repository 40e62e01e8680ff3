//! A pulse's samples summed at many delays: a polynomial in the phasor from sample to sample, by Horner's rule.
//!
//! ```text
//! sum[i] = sum_k w[k] z[k] step[i]^k
//! ```
//!
//! In float64 ([`sums`]) products and sums are rounded apart; rounding: that of `K` steps of Horner's rule,
//! `K` times 2^-53 of the sum of magnitudes at most. Narrowly ([`narrow_sums`]) runs of [`RUN`] samples are float32, with fused products,
//! and joined in float64: the step's rounding turns a sample by up to [`RUN`] times 6e-8, 4e-7 RMS at most ([`NARROW_RMS`]). Either has one
//! order: the same bits in all instruction sets.
//!
//! Cost: 8 operations a sample and delay; narrow ones go three to five times as fast.

use num_complex::{Complex32, Complex64};

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Delays summed side by side: enough to hide the latency of Horner's chain.
pub const TOGETHER: usize = 16;

/// The sums of `samples` with their `weights` for each of `steps`.
///
/// # Panics
/// If there are not as many weights as samples.
pub fn sums(
    instructions: Instructions,
    samples: &[Complex32],
    weights: &[f64],
    steps: &[Complex64; TOGETHER],
) -> [Complex64; TOGETHER] {
    assert_eq!(samples.len(), weights.len());
    instructions.run(Sums {
        samples,
        weights,
        steps,
    })
}

struct Sums<'a> {
    samples: &'a [Complex32],
    weights: &'a [f64],
    steps: &'a [Complex64; TOGETHER],
}

impl Kernel for Sums<'_> {
    type Output = [Complex64; TOGETHER];

    /// A plain loop: what the lanes' instructions make of it.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Self::Output {
        let step_re = self.steps.map(|z| z.re);
        let step_im = self.steps.map(|z| z.im);
        let [mut re, mut im] = [[0.0; TOGETHER]; 2];
        for (z, w) in self.samples.iter().zip(self.weights).rev() {
            let (z_re, z_im) = (f64::from(z.re) * w, f64::from(z.im) * w);
            for i in 0..TOGETHER {
                let (a, b) = (re[i], im[i]);
                re[i] = a * step_re[i] - b * step_im[i] + z_re;
                im[i] = a * step_im[i] + b * step_re[i] + z_im;
            }
        }
        std::array::from_fn(|i| Complex64::new(re[i], im[i]))
    }
}

/// Samples that are summed narrowly.
pub const RUN: usize = 16;
/// Relative RMS error of narrow sums, beside that of samples that add at random.
pub const NARROW_RMS: f64 = 4e-7;
/// Delays summed side by side narrowly.
pub const NARROW_TOGETHER: usize = 4 * GROUP;

/// The sums of `samples` with their `weights` for each of `steps`, good to [`NARROW_RMS`].
///
/// # Panics
/// If there are not as many weights as samples.
pub fn narrow_sums(
    instructions: Instructions,
    samples: &[Complex32],
    weights: &[f32],
    steps: &[Complex64; NARROW_TOGETHER],
) -> [Complex64; NARROW_TOGETHER] {
    assert_eq!(samples.len(), weights.len());
    instructions.run(NarrowSums {
        samples,
        weights,
        steps,
    })
}

struct NarrowSums<'a> {
    samples: &'a [Complex32],
    weights: &'a [f32],
    steps: &'a [Complex64; NARROW_TOGETHER],
}

/// Vectors that are worked on together: enough to hide the latency of Horner's chain.
const VECTORS: usize = 4;

impl Kernel for NarrowSums<'_> {
    type Output = [Complex64; NARROW_TOGETHER];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Self::Output {
        const N: usize = NARROW_TOGETHER;
        let [mut step_re, mut step_im, mut run_re, mut run_im] = [[0.0f32; N]; 4];
        let [mut power_re, mut power_im, mut re, mut im] = [[0.0f64; N]; 4];
        for (i, step) in self.steps.iter().enumerate() {
            (step_re[i], step_im[i]) = (step.re as f32, step.im as f32);
            let mut power = *step;
            for _ in 0..RUN.ilog2() {
                power *= power;
            }
            (power_re[i], power_im[i]) = (power.re, power.im);
        }
        // What does not fill a run comes first: it is last.
        let whole = self.samples.len() / RUN * RUN;
        let ends = (0..whole).step_by(RUN).map(|first| first..first + RUN);
        let runs = ends.chain(std::iter::once(whole..self.samples.len()));
        for run in runs.rev() {
            for from in (0..N).step_by(VECTORS * L::COUNT) {
                let nothing = [lanes.splat(0.0); VECTORS];
                let [mut w_re, mut w_im, mut s_re, mut s_im] = [nothing; 4];
                for v in 0..VECTORS {
                    w_re[v] = lanes.load(&step_re[from + v * L::COUNT..]);
                    w_im[v] = lanes.load(&step_im[from + v * L::COUNT..]);
                }
                for k in run.clone().rev() {
                    let (z, weight) = (self.samples[k], self.weights[k]);
                    let (z_re, z_im) = (lanes.splat(z.re * weight), lanes.splat(z.im * weight));
                    for v in 0..VECTORS {
                        let real = lanes.neg_mul_add(s_im[v], w_im[v], z_re);
                        let imaginary = lanes.mul_add(s_im[v], w_re[v], z_im);
                        s_im[v] = lanes.mul_add(s_re[v], w_im[v], imaginary);
                        s_re[v] = lanes.mul_add(s_re[v], w_re[v], real);
                    }
                }
                for v in 0..VECTORS {
                    lanes.store(s_re[v], &mut run_re[from + v * L::COUNT..]);
                    lanes.store(s_im[v], &mut run_im[from + v * L::COUNT..]);
                }
            }
            for i in 0..N {
                let (a, b) = (re[i], im[i]);
                re[i] = a * power_re[i] - b * power_im[i] + f64::from(run_re[i]);
                im[i] = a * power_im[i] + b * power_re[i] + f64::from(run_im[i]);
            }
        }
        let mut sums = [Complex64::ZERO; N];
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = Complex64::new(re[i], im[i]);
        }
        sums
    }
}
