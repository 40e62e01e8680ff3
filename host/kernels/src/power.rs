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

/// Partial sums: so many that the compiler makes vectors of their loops.
const PARTS: usize = 64;

struct OfLevel<'a> {
    powers: &'a [f64],
    threshold: f64,
}

/// Statistics of every [`PARTS`]-th power.
struct Partial {
    all: [f64; PARTS],
    weak: [f64; PARTS],
    count: [f64; PARTS],
    peak: [f64; PARTS],
}

impl Partial {
    /// One loop per statistic: the compiler vectorises each.
    #[inline(always)]
    fn add(&mut self, powers: &[f64; PARTS], threshold: f64) {
        let mut is_weak = [0.0; PARTS];
        for (is_weak, &power) in is_weak.iter_mut().zip(powers) {
            *is_weak = if power <= threshold { 1.0 } else { 0.0 };
        }
        for (sum, &power) in self.all.iter_mut().zip(powers) {
            *sum += power;
        }
        for ((sum, &power), &is_weak) in self.weak.iter_mut().zip(powers).zip(&is_weak) {
            *sum += is_weak * power;
        }
        for (sum, &is_weak) in self.count.iter_mut().zip(&is_weak) {
            *sum += is_weak;
        }
        for (most, &power) in self.peak.iter_mut().zip(powers) {
            *most = if power > *most { power } else { *most };
        }
    }
}

impl Kernel for OfLevel<'_> {
    type Output = Level;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Level {
        let mut sums = Partial {
            all: [0.0; PARTS],
            weak: [0.0; PARTS],
            count: [0.0; PARTS],
            peak: [0.0; PARTS],
        };
        let (chunks, rest) = self.powers.as_chunks::<PARTS>();
        for chunk in chunks {
            sums.add(chunk, self.threshold);
        }
        let mut level = Level {
            all: sums.all.iter().sum(),
            weak: sums.weak.iter().sum(),
            count: sums.count.iter().sum(),
            peak: sums.peak.iter().copied().fold(0.0, f64::max),
        };
        for &power in rest {
            let is_weak = power <= self.threshold;
            level.add(&Level {
                all: power,
                weak: if is_weak { power } else { 0.0 },
                count: if is_weak { 1.0 } else { 0.0 },
                peak: power,
            });
        }
        level
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
