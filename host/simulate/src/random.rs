//! Random numbers from a stream, bit-identical on every machine since logarithms are computed by libm.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// Uniform random number in [0, 1) with 53 bits.
pub fn unit(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Complex Gaussian random number, both parts of variance 1.
///
/// Marsaglia's polar method: for a uniform point in the unit disc, direction and distance are independent, and `-2
/// ln(distance^2)` has the distribution of the squared magnitude.
pub(crate) fn complex_normal(random: &mut ChaCha8Rng) -> Complex64 {
    loop {
        let place = Complex64::new(2.0 * unit(random) - 1.0, 2.0 * unit(random) - 1.0);
        let squared = place.norm_sqr();
        if squared < 1.0 && squared > 0.0 {
            return place * (-2.0 * libm::log(squared) / squared).sqrt();
        }
    }
}

/// Real Gaussian random number of variance 1.
pub(crate) fn normal(random: &mut ChaCha8Rng) -> f64 {
    complex_normal(random).re
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    /// Moments of 100,000 numbers agree with the distribution within 5 standard deviations, and so do the counts beyond
    /// one, two and three standard deviations.
    #[test]
    fn real_and_imaginary_parts_are_gaussian_and_independent() {
        let count = 100_000;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let numbers: Vec<Complex64> = (0..count).map(|_| complex_normal(&mut random)).collect();
        let within = |name: &str, value: fn(Complex64) -> f64, mean: f64, variance: f64| {
            let sum: f64 = numbers.iter().map(|&z| value(z)).sum();
            let allowed = 5.0 * (variance / f64::from(count)).sqrt();
            let off = sum / f64::from(count) - mean;
            assert!(off.abs() < allowed, "{name}: {off} of {allowed}");
        };
        within("re", |z| z.re, 0.0, 1.0);
        within("im", |z| z.im, 0.0, 1.0);
        within("re^2", |z| z.re * z.re, 1.0, 2.0);
        within("im^2", |z| z.im * z.im, 1.0, 2.0);
        within("re im", |z| z.re * z.im, 0.0, 1.0);
        within("re^2 im^2", |z| (z.re * z.im).powi(2), 1.0, 8.0);
        within("re^4", |z| z.re.powi(4), 3.0, 96.0);
        for (deviations, part) in [
            (1.0, 0.317_310_508),
            (2.0, 0.045_500_264),
            (3.0, 0.002_699_796),
        ] {
            let beyond = numbers.iter().filter(|z| z.im.abs() > deviations).count() as f64;
            let (expected, allowed) = (
                part * f64::from(count),
                5.0 * (part * f64::from(count)).sqrt(),
            );
            assert!(
                (beyond - expected).abs() < allowed,
                "{beyond} beyond {deviations}"
            );
        }
    }
}
