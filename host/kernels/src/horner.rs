//! A pulse's samples summed at many delays: a polynomial in the phasor from sample to sample, by Horner's rule, in float64.
//!
//! ```text
//! sum[i] = sum_k w[k] z[k] step[i]^k
//! ```
//!
//! Products and sums are rounded apart, in one order: the same bits in all instruction sets. Rounding: that of `K` steps of Horner's rule,
//! `K` times 2^-53 of the sum of magnitudes at most.
//!
//! Cost: 8 operations a sample and delay.

use num_complex::{Complex32, Complex64};

use crate::lanes::{Instructions, Kernel, Lanes};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};

    #[test]
    fn sums_are_what_they_say() {
        let mut numbers = Numbers::new(1);
        for count in [0, 1, 77, 1000] {
            let samples = numbers.samples(count);
            let weights: Vec<f64> = (0..count).map(|_| numbers.unit()).collect();
            let turns: [f64; TOGETHER] = std::array::from_fn(|_| numbers.signed());
            let got = sums(
                Instructions::Portable,
                &samples,
                &weights,
                &turns.map(turned),
            );
            for (got, turns) in got.iter().zip(turns) {
                let terms = samples.iter().zip(&weights).enumerate();
                let expected: Complex64 = terms
                    .map(|(k, (&z, w))| wide(z) * w * turned(turns * k as f64))
                    .sum();
                let error = (got - expected).norm();
                // The step's own rounding, 1e-16, is taken to the power of up to `count`.
                assert!(
                    error <= 1e-16 * (3 * count * count) as f64,
                    "{count}: {error}"
                );
            }
            for instructions in Instructions::available() {
                let other = sums(instructions, &samples, &weights, &turns.map(turned));
                assert!(other == got, "{}", instructions.name());
            }
        }
    }
}
