//! Distributions of Student's t and of chi-square, for the tests on held-out data.

use libm::{exp, lgamma, log};

/// Terms of a series or a continued fraction, and the relative size of a term that ends it.
const MAX_TERMS: usize = 1000;
const LAST_TERM: f64 = 1e-14;

/// Probability that Student's t with `freedom` degrees of freedom exceeds `t`.
pub(crate) fn student_above(t: f64, freedom: f64) -> f64 {
    let beyond = 0.5 * incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + t * t));
    match t > 0.0 {
        true => beyond,
        false => 1.0 - beyond,
    }
}

/// Probability that chi-square with `freedom` degrees of freedom is at most `x`: the regularised lower incomplete gamma function by its series.
pub(crate) fn chi_square_below(x: f64, freedom: f64) -> f64 {
    let (shape, x) = (0.5 * freedom, 0.5 * x);
    if x <= 0.0 {
        return 0.0;
    }
    // The series needs about x terms, and 1 is reached long before.
    if x > shape + 40.0 + 10.0 * shape.sqrt() {
        return 1.0;
    }
    let mut term = 1.0 / shape;
    let mut sum = term;
    for k in 1..MAX_TERMS {
        term *= x / (shape + k as f64);
        sum += term;
        if term < LAST_TERM * sum {
            break;
        }
    }
    (sum * exp(shape * log(x) - x - lgamma(shape))).min(1.0)
}

/// Regularised incomplete beta function `I_x(a, b)` by its continued fraction (modified Lentz).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // The fraction converges fast below the mean.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    let front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log(1.0 - x) - log(a));
    let (mut c, mut d, mut fraction) = (1.0, 0.0, 1.0);
    for i in 0..MAX_TERMS {
        let m = (i / 2) as f64;
        let numerator = match (i, i % 2) {
            (0, _) => 1.0,
            (_, 0) => m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            _ => -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        };
        d = 1.0 + numerator * d;
        d = 1.0 / if d.abs() < 1e-300 { 1e-300 } else { d };
        c = 1.0 + numerator / c;
        c = if c.abs() < 1e-300 { 1e-300 } else { c };
        fraction *= c * d;
        if (1.0 - c * d).abs() < LAST_TERM {
            break;
        }
    }
    front * (fraction - 1.0)
}

/// Gaussian random number for tests: sum of twelve numbers of Knuth's generator.
#[cfg(test)]
pub(crate) fn gauss(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_agrees_with_tables() {
        // Abramowitz and Stegun, table 26.10, to the digits printed there.
        for (t, freedom, above) in [
            (31.821, 1.0, 0.01),
            (4.541, 3.0, 0.01),
            (2.764, 10.0, 0.01),
            (1.812, 10.0, 0.05),
            (2.358, 120.0, 0.01),
        ] {
            let found = student_above(t, freedom);
            assert!((found / above - 1.0).abs() < 2e-3, "{t} {freedom}: {found}");
            assert!((student_above(-t, freedom) - 1.0 + found).abs() < 1e-12);
        }
        // Cauchy's distribution in closed form.
        let cauchy = 0.5 - libm::atan(0.3) / std::f64::consts::PI;
        assert!((student_above(0.3, 1.0) - cauchy).abs() < 1e-12);
        assert!((student_above(0.0, 7.5) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn chi_square_agrees_with_tables() {
        // Abramowitz and Stegun, table 26.8.
        for (x, freedom, below) in [
            (1.0, 2.0, 1.0 - (-0.5f64).exp()),
            (0.114832, 3.0, 0.01),
            (0.872085, 6.0, 0.01),
            (18.3070, 10.0, 0.95),
            (135.807, 100.0, 0.99),
        ] {
            let found = chi_square_below(x, freedom);
            assert!((found / below - 1.0).abs() < 1e-4, "{x} {freedom}: {found}");
        }
        assert_eq!(chi_square_below(0.0, 3.0), 0.0);
        assert_eq!(chi_square_below(1e6, 3.0), 1.0);
    }
}
