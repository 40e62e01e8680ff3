//! Chi-square quantile of 3 degrees of freedom.

/// Value that chi-square of 3 degrees of freedom exceeds with the probability `above`, by bisection of
/// `erfc(sqrt(x / 2)) + sqrt(2 x / pi) exp(-x / 2)`. Relative error below 1e-12.
pub(super) fn quantile(above: f64) -> f64 {
    // Every float64 probability above 0 has its quantile in this interval.
    let (mut low, mut high) = (0.0, 1600.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match exceedance(middle) > above {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

fn exceedance(x: f64) -> f64 {
    let half = 0.5 * x;
    libm::erfc(half.sqrt()) + (4.0 * half / std::f64::consts::PI).sqrt() * libm::exp(-half)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantile_agrees_with_tables() {
        // Abramowitz and Stegun, table 26.8, to the digits printed there.
        for (above, value) in [
            (0.99, 0.114832),
            (0.5, 2.36597),
            (0.05, 7.81473),
            (0.01, 11.3449),
            (0.001, 16.2662),
            (0.0001, 21.1075),
        ] {
            let found = quantile(above);
            assert!((found / value - 1.0).abs() < 1e-5, "{above}: {found}");
        }
    }

    /// The density `sqrt(x / (2 pi)) exp(-x / 2)`, summed above the quantile by the midpoint rule.
    #[test]
    fn density_above_the_quantile_sums_to_its_probability() {
        for above in [0.9, 0.1, 1e-3, 1e-6] {
            let (start, step) = (quantile(above), 1e-3);
            let sum: f64 = (0..100_000)
                .map(|i| start + (f64::from(i) + 0.5) * step)
                .map(|x| (x / std::f64::consts::TAU).sqrt() * (-x / 2.0).exp() * step)
                .sum();
            // The midpoint rule's relative error is step^2 / 24 times the density's curvature, below 1e-6.
            assert!((sum / above - 1.0).abs() < 1e-6, "{above}: {sum}");
        }
    }
}
