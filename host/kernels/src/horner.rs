//! Sum of a pulse's samples at many delays: polynomial in the phasor step, by Horner's rule.
//!
//! ```text
//! sum[i] = sum_k w[k] z[k] step[i]^k
//! ```
//!
//! **Accuracy** [`sums`] is float64 without fused operations: `K` Horner steps, an error of at most
//! `K` times 2^-53 of the sum of magnitudes, in a fixed order and bit-identical in all instruction sets. Where 4e-7 is enough,
//! [`super::folded_sums`] are ten times as fast.
//!
//! **Cost** 8 operations per sample and delay.

use num_complex::{Complex32, Complex64};

use crate::lanes::{Instructions, Kernel, Lanes};

/// Delays evaluated together, to hide the latency of Horner's chain.
pub const TOGETHER: usize = 16;

/// Sum weighted `samples` for each phasor step, in float64.
///
/// # Panics
/// If the numbers of weights and samples differ.
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

    /// Scalar loop, vectorised by the compiler.
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
