use crate::trial::{Numbers, turned, wide};
use num_complex::Complex64;
use subaperture_kernels::folded_sums::*;
use subaperture_kernels::lanes::Instructions;

#[test]
fn folded_sums_error_is_as_documented() {
    let mut numbers = Numbers::new(2);
    for count in [0, 1, 16, 64, 77, 1000, 4096] {
        let samples = numbers.samples(count);
        let weights: Vec<f64> = (0..count).map(|_| numbers.unit()).collect();
        let narrow_weights: Vec<f32> = weights.iter().map(|&w| w as f32).collect();
        let turns: [f64; TOGETHER] = std::array::from_fn(|_| numbers.signed());
        let got = folded_sums(Instructions::Portable, &samples, &narrow_weights, &turns);
        let (mut error, mut power) = (0.0, 0.0);
        for (got, turns) in got.iter().zip(turns) {
            let terms = samples.iter().zip(&weights).enumerate();
            let expected: Complex64 = terms
                .map(|(k, (&z, w))| wide(z) * w * turned(turns * k as f64))
                .sum();
            error += (got - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        assert!(
            error.sqrt() <= RMS * power.sqrt(),
            "{count}: {error} {power}"
        );
        for instructions in Instructions::available() {
            let other = folded_sums(instructions, &samples, &narrow_weights, &turns);
            assert!(other == got, "{}", instructions.name());
        }
    }
}
