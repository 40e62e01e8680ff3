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
//! `Q` over the density of `x_(r)` is a sum over the logarithm of the level. The integrand is smooth, so steps of a fifth
//! are accurate to 1e-3 of the probability. **Cost**: some ten thousand exponentials per setup.

/// CA-CFAR factor of the sum of `cells` cells of `channels` powers each, for the given false-alarm probability.
pub(super) fn cell_averaging_factor(probability: f64, channels: usize, cells: f64) -> f64 {
    let shape = channels as f64 * cells;
    solve(probability, |k| {
        let (mut term, mut sum) = (libm::exp(-shape * libm::log1p(k)), 0.0);
        for i in 0..channels {
            sum += term;
            term *= (shape + i as f64) / (i as f64 + 1.0) * k / (1.0 + k);
        }
        sum
    })
}

/// Rank as a cell number from 1, for a rank given as a fraction.
pub(super) fn rank_of(rank: f64, count: usize) -> usize {
    (libm::ceil(rank * count as f64) as usize).max(1).min(count)
}

/// OS-CFAR factor of the `rank`-th smallest of `count` cells, for the given false-alarm probability.
pub(super) fn order_statistic_factor(
    probability: f64,
    channels: usize,
    count: usize,
    rank: usize,
) -> f64 {
    const STEPS: usize = 180;
    const LOWEST: f64 = 1e-12;
    // The density above this level is below 1e-15.
    let most = channels as f64 + 12.0 * libm::sqrt(channels as f64) + 40.0;
    let (n, r, shape) = (count as f64, rank as f64, channels as f64);
    let step = libm::log(most / LOWEST) / STEPS as f64;
    let ratio = libm::exp(step);
    // Sampled at the middle of each step. A common factor cancels in the normalisation by `total`.
    let first = LOWEST * libm::exp(0.5 * step);
    let (mut x, mut total) = (first, 0.0);
    let mut weights = [0.0; STEPS];
    for weight in &mut weights {
        let below = match rank {
            1 => 0.0,
            _ => (r - 1.0) * libm::log(gamma_lower_tail(channels, x)),
        };
        let own = shape * libm::log(x) - x;
        *weight =
            libm::exp(below + (n - r) * libm::log(gamma_upper_tail(channels, x)) + own + n * shape);
        total += *weight;
        x *= ratio;
    }
    solve(probability, |k| {
        let (mut x, mut sum) = (first, 0.0);
        for weight in &weights {
            sum += weight * gamma_upper_tail(channels, k * x);
            x *= ratio;
        }
        sum / total
    })
}

/// Upper tail of a gamma distribution, `exp(-x) sum_(i < shape) x^i / i!`.
fn gamma_upper_tail(shape: usize, x: f64) -> f64 {
    let (mut term, mut sum) = (libm::exp(-x), 0.0);
    for i in 0..shape {
        sum += term;
        term *= x / (i as f64 + 1.0);
    }
    sum
}

/// Lower tail of a gamma distribution: 1 minus [`gamma_upper_tail`], without cancellation.
fn gamma_lower_tail(shape: usize, x: f64) -> f64 {
    if x > 1.0 {
        return 1.0 - gamma_upper_tail(shape, x);
    }
    let mut term = libm::exp(-x);
    for i in 0..shape {
        term *= x / (i as f64 + 1.0);
    }
    let mut sum = 0.0;
    for i in 0..20 {
        sum += term;
        term *= x / (shape + i + 1) as f64;
    }
    sum
}

/// Solve `falling(k) = probability` for a function that decreases from 1 to 0.
fn solve(probability: f64, falling: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (-30.0, 60.0);
    // To seven digits.
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        match falling(libm::exp2(middle)) > probability {
            true => low = middle,
            false => high = middle,
        }
    }
    libm::exp2(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: C (7.8) for one channel, and the known product for ordered cells (Rohling 1983).
    #[test]
    fn cfar_factors_match_closed_forms_for_one_channel() {
        for (probability, cells) in [(1e-2f64, 5), (1e-4, 16), (1e-6, 32)] {
            let n = f64::from(cells);
            let known = libm::pow(probability, -1.0 / n) - 1.0;
            let got = cell_averaging_factor(probability, 1, n);
            assert!((got / known - 1.0).abs() < 1e-6, "{cells}: {got} {known}");
            for rank in [cells / 2, (3 * cells) / 4, cells] {
                let factor = order_statistic_factor(probability, 1, cells as usize, rank as usize);
                let product = (0..rank).fold(1.0, |product, i| {
                    let left = n - f64::from(i);
                    product * left / (left + factor)
                });
                let off = product / probability - 1.0;
                assert!(off.abs() < 2e-3, "{cells} {rank}: {off}");
            }
        }
    }

    /// Reference for two channels: the tail of the gamma distribution, `exp(-x) (1 + x)`.
    #[test]
    fn gamma_tails_sum_to_one() {
        for x in [1e-6, 0.1, 0.9, 1.1, 4.0] {
            let two = libm::exp(-x) * (1.0 + x);
            assert!((gamma_upper_tail(2, x) - two).abs() < 1e-15);
            for shape in [1, 2, 5, 8] {
                assert!(
                    (gamma_upper_tail(shape, x) + gamma_lower_tail(shape, x) - 1.0).abs() < 1e-14
                );
            }
        }
    }
}
