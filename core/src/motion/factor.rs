//! CFAR threshold factors of the module ([`super::threshold`]) with few steps.
//!
//! Steps of a fifth over the logarithm of the level are accurate to 1e-3 of the probability. **Cost**: some ten thousand exponentials
//! per setup.

use super::threshold::{self, Bisection, leading_product, log_order_density};

/// Search to a precision of seven digits.
const SEARCH: Bisection = Bisection {
    log2: [-30.0, 60.0],
    steps: 30,
};

/// CA-CFAR factor of the sum of `cells` cells of `channels` powers each, for the given false-alarm probability.
pub(super) fn cell_averaging_factor(probability: f64, channels: usize, cells: f64) -> f64 {
    threshold::cell_averaging_factor(probability, channels, cells, SEARCH)
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
    let (n, shape) = (count as f64, channels as f64);
    let step = libm::log(most / LOWEST) / STEPS as f64;
    let ratio = libm::exp(step);
    // Sampled at the middle of each step. A common factor cancels.
    let first = LOWEST * libm::exp(0.5 * step);
    let mut x = first;
    let mut weights = [0.0; STEPS];
    for weight in &mut weights {
        let [smaller, larger, own] = log_order_density(channels, (rank, count), x, leading_product);
        *weight = libm::exp(smaller + larger + own + n * shape);
        x *= ratio;
    }
    let levels = weights.iter().scan(first, |x, &weight| {
        let level = *x;
        *x *= ratio;
        Some((level, weight))
    });
    threshold::order_statistic_factor(probability, channels, levels, SEARCH)
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
}
