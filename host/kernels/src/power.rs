//! Power of a pulse: sum of squared magnitudes.

use num_complex::Complex32;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Sum of squared magnitudes of weighted `samples`.
///
/// Summed in float64; relative error 1e-7 by the weights' float32 products.
///
/// # Panics
/// If the numbers of weights and samples differ.
pub fn power(instructions: Instructions, samples: &[Complex32], weights: &[f32]) -> f64 {
    assert_eq!(samples.len(), weights.len());
    instructions.run(Power { samples, weights })
}

struct Power<'a> {
    samples: &'a [Complex32],
    weights: &'a [f32],
}

impl Kernel for Power<'_> {
    type Output = f64;

    /// Plain loops: what the lanes' instructions make of them.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> f64 {
        let mut sums = [0.0f64; GROUP];
        for (samples, weights) in self.samples.chunks(GROUP).zip(self.weights.chunks(GROUP)) {
            for ((sum, z), w) in sums.iter_mut().zip(samples).zip(weights) {
                let (re, im) = (f64::from(z.re * w), f64::from(z.im * w));
                *sum += re * re + im * im;
            }
        }
        sums.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, wide};

    #[test]
    fn power_agrees_with_sum_of_squares() {
        let mut numbers = Numbers::new(3);
        for count in [0, 1, 77, 1000] {
            let samples = numbers.samples(count);
            let weights: Vec<f32> = (0..count).map(|_| numbers.unit() as f32).collect();
            let terms = samples.iter().zip(&weights);
            let expected: f64 = terms
                .map(|(&z, &w)| wide(z).norm_sqr() * f64::from(w).powi(2))
                .sum();
            for instructions in Instructions::available() {
                let got = power(instructions, &samples, &weights);
                assert!(
                    (got - expected).abs() <= 1e-6 * expected,
                    "{count}: {got} {expected}"
                );
                assert_eq!(got, power(Instructions::Portable, &samples, &weights));
            }
        }
    }
}
