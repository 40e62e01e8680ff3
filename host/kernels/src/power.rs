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

/// Squared magnitudes in float64: those of very small or large float32 values underflow or overflow in float32.
///
/// # Panics
/// If the numbers of values and powers differ.
pub fn powers(instructions: Instructions, values: &[Complex32], powers: &mut [f64]) {
    assert_eq!(values.len(), powers.len());
    instructions.run(Powers { values, powers });
}

struct Powers<'a> {
    values: &'a [Complex32],
    powers: &'a mut [f64],
}

impl Kernel for Powers<'_> {
    type Output = ();

    /// A plain loop, vectorised by the compiler.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (power, z) in self.powers.iter_mut().zip(self.values) {
            let (re, im) = (f64::from(z.re), f64::from(z.im));
            *power = re * re + im * im;
        }
    }
}

/// Statistics of powers: sum, sum and count of those up to a threshold, and maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// Sum of all powers.
    pub all: f64,
    /// Sum of the powers up to the threshold.
    pub weak: f64,
    /// Number of powers up to the threshold.
    pub count: f64,
    /// Largest of all powers.
    pub peak: f64,
}

impl Level {
    /// Statistics of `powers` for a threshold.
    pub fn of(instructions: Instructions, powers: &[f64], threshold: f64) -> Self {
        instructions.run(OfLevel { powers, threshold })
    }

    /// Combine with the statistics of other powers.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.all += other.all;
        self.weak += other.weak;
        self.count += other.count;
        self.peak = self.peak.max(other.peak);
    }

    /// Mean of the powers up to the threshold.
    pub fn mean(&self) -> f64 {
        self.weak / self.count.max(1.0)
    }
}

/// Partial sums, which the compiler keeps in vectors.
const PARTS: usize = 32;

struct OfLevel<'a> {
    powers: &'a [f64],
    threshold: f64,
}

/// Combine every [`PARTS`]-th power, from 0 on.
#[inline(always)]
fn combined(powers: &[f64], with: impl Fn(f64, f64) -> f64) -> [f64; PARTS] {
    let mut parts = [0.0; PARTS];
    let (chunks, rest) = powers.as_chunks::<PARTS>();
    for chunk in chunks {
        for (part, &power) in parts.iter_mut().zip(chunk) {
            *part = with(*part, power);
        }
    }
    for (part, &power) in parts.iter_mut().zip(rest) {
        *part = with(*part, power);
    }
    parts
}

impl Kernel for OfLevel<'_> {
    type Output = Level;

    /// One pass per statistic: the compiler does not vectorise them together.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Level {
        let Self { powers, threshold } = self;
        let sum = |parts: [f64; PARTS]| parts.iter().sum();
        let weak = |power: f64, value: f64| if power <= threshold { value } else { 0.0 };
        let most = |most: f64, power: f64| if power > most { power } else { most };
        Level {
            all: sum(combined(powers, |sum, power| sum + power)),
            weak: sum(combined(powers, |sum, power| sum + weak(power, power))),
            count: sum(combined(powers, |sum, power| sum + weak(power, 1.0))),
            peak: combined(powers, most).into_iter().fold(0.0, f64::max),
        }
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

    #[test]
    fn levels_agree_with_sums_of_each_power() {
        let values = Numbers::new(4).samples(1003);
        for instructions in Instructions::available() {
            let mut all = vec![0.0; values.len()];
            powers(instructions, &values, &mut all);
            let level = Level::of(instructions, &all, 0.25);
            let weak = || all.iter().filter(|&&power| power <= 0.25);
            let [sum, sum_of_weak] = [all.iter().sum::<f64>(), weak().sum()];
            assert!((level.all - sum).abs() < 1e-10 && (level.weak - sum_of_weak).abs() < 1e-10);
            assert_eq!(level.count, weak().count() as f64);
            assert_eq!(level.peak, all.iter().copied().fold(0.0, f64::max));
            let largest = values
                .iter()
                .map(|&z| wide(z).norm_sqr())
                .fold(0.0, f64::max);
            assert!((level.peak - largest).abs() < 1e-15);
        }
    }
}
