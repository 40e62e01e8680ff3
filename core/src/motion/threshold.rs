//! CFAR thresholds over the mean or an order statistic of the training cells (CA-CFAR and OS-CFAR).
//!
//! **Equation.** For a cell of power `p`, summed over `C` channels of independent complex Gaussian noise, and `N` training cells:
//!
//! ```text
//! mean      p > k sum x_n,   Pfa = sum_(i < C) binom(C N + i - 1, i) k^i / (1 + k)^(C N + i)
//! ordered   p > k x_(r),     Pfa = E Q(C, k x_(r)),   x_(r) the r-th smallest,   Q(C, x) = exp(-x) sum_(i < C) x^i / i!
//! ```
//!
//! Chim 2018 (7.8) is the first for `C = 1`. Targets among the training cells raise the mean; with few cells two targets of
//! equal strength mask each other. They hardly raise a cell in the middle of the order (Rohling 1983). The expectation of
//! `Q` over the density of `x_(r)` is a sum over the logarithm of the level. The caller chooses its steps and those of the bisection: the
//! module few of them (`profile`), the host many.

/// Bisection that solves for a threshold factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bisection {
    /// Binary logarithms between which the factor lies.
    pub log2: [f64; 2],
    /// Number of steps; each halves the interval.
    pub steps: u32,
}

impl Bisection {
    /// Solve `falling(k) = probability` for a function that decreases from 1 to 0.
    fn solve(self, probability: f64, falling: impl Fn(f64) -> f64) -> f64 {
        let [mut low, mut high] = self.log2;
        for _ in 0..self.steps {
            let middle = 0.5 * (low + high);
            match falling(libm::exp2(middle)) > probability {
                true => low = middle,
                false => high = middle,
            }
        }
        libm::exp2(high)
    }
}

/// CA-CFAR factor of the sum of `cells` cells of `channels` powers each, for the given false-alarm probability.
pub fn cell_averaging_factor(
    probability: f64,
    channels: usize,
    cells: f64,
    search: Bisection,
) -> f64 {
    let shape = channels as f64 * cells;
    search.solve(probability, |k| {
        let (mut term, mut sum) = (libm::exp(-shape * libm::log1p(k)), 0.0);
        for i in 0..channels {
            sum += term;
            term *= (shape + i as f64) / (i as f64 + 1.0) * k / (1.0 + k);
        }
        sum
    })
}

/// Rank as a cell number from 1, for a rank given as a fraction.
pub fn rank_of(rank: f64, count: usize) -> usize {
    (libm::ceil(rank * count as f64) as usize).max(1).min(count)
}

/// OS-CFAR factor of a cell of `channels` powers, for the given false-alarm probability. `levels` are levels of the
/// order statistic with their probabilities up to a common factor.
pub fn order_statistic_factor(
    probability: f64,
    channels: usize,
    levels: impl Iterator<Item = (f64, f64)> + Clone,
    search: Bisection,
) -> f64 {
    let total = levels
        .clone()
        .fold(0.0, |total, (_, weight)| total + weight);
    search.solve(probability, |k| {
        let tails = levels.clone();
        let tails = tails.map(|(x, weight)| weight * gamma_upper_tail(channels, k * x));
        tails.fold(0.0, |sum, tail| sum + tail) / total
    })
}

/// Logarithm of the density of the `rank`-th smallest of `count` cells at level `x`, over `log x` and up to a constant: the terms of
/// the smaller cells, of the larger ones and of the cell itself. `leading` is that of [`gamma_lower_tail`].
pub fn log_order_density(
    channels: usize,
    (rank, count): (usize, usize),
    x: f64,
    leading: impl Fn(usize, f64) -> f64,
) -> [f64; 3] {
    let (n, r) = (count as f64, rank as f64);
    let smaller = match rank {
        1 => 0.0,
        _ => (r - 1.0) * libm::log(gamma_lower_tail(channels, x, leading)),
    };
    let larger = (n - r) * libm::log(gamma_upper_tail(channels, x));
    [smaller, larger, channels as f64 * libm::log(x) - x]
}

/// Upper tail of a gamma distribution, `exp(-x) sum_(i < shape) x^i / i!`.
pub fn gamma_upper_tail(shape: usize, x: f64) -> f64 {
    let (mut term, mut sum) = (libm::exp(-x), 0.0);
    for i in 0..shape {
        sum += term;
        term *= x / (i as f64 + 1.0);
    }
    sum
}

/// Lower tail of a gamma distribution: 1 minus [`gamma_upper_tail`], without cancellation. `leading(shape, x)` is its leading term
/// `x^shape exp(-x) / shape!`: a product for few channels ([`leading_product`]), or by the logarithm of the factorial.
pub fn gamma_lower_tail(shape: usize, x: f64, leading: impl Fn(usize, f64) -> f64) -> f64 {
    if x > 1.0 {
        return 1.0 - gamma_upper_tail(shape, x);
    }
    let (mut term, mut sum) = (leading(shape, x), 0.0);
    for i in 0..20 {
        sum += term;
        term *= x / (shape + i + 1) as f64;
    }
    sum
}

/// Leading term `x^shape exp(-x) / shape!` of [`gamma_lower_tail`] as a product.
pub fn leading_product(shape: usize, x: f64) -> f64 {
    let mut term = libm::exp(-x);
    for i in 0..shape {
        term *= x / (i as f64 + 1.0);
    }
    term
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference for two channels: the tail of the gamma distribution, `exp(-x) (1 + x)`.
    #[test]
    fn gamma_tails_sum_to_one() {
        for x in [1e-6, 0.1, 0.9, 1.1, 4.0] {
            let two = libm::exp(-x) * (1.0 + x);
            assert!((gamma_upper_tail(2, x) - two).abs() < 1e-15);
            for shape in [1, 2, 5, 8] {
                assert!(
                    (gamma_upper_tail(shape, x) + gamma_lower_tail(shape, x, leading_product)
                        - 1.0)
                        .abs()
                        < 1e-14
                );
            }
        }
    }
}
