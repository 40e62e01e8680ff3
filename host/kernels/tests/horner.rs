use crate::trial::{Numbers, turned, wide};
use num_complex::Complex64;
use subaperture_kernels::horner::*;
use subaperture_kernels::lanes::Instructions;

#[test]
fn horner_sums_agree_with_defining_sum() {
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
            // The step's rounding, 1e-16, is raised to powers up to `count`.
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
