//! Thresholds of a constant rate of false alarms, over the mean of training cells or over one of them in order.
//!
//! **Equation.** Of a cell of power `p`, summed over `C` channels of independent complex Gaussian noise, and `N` training cells:
//!
//! ```text
//! mean      p > k sum x_n,   Pfa = sum_(i < C) binom(C N + i - 1, i) k^i / (1 + k)^(C N + i)
//! ordered   p > k x_(r),     Pfa = E Q(C, k x_(r)),   x_(r) the r-th smallest,   Q(C, x) = exp(-x) sum_(i < C) x^i / i!
//! ```
//!
//! Chim 2018 (7.8) is the first for `C = 1`. Other targets among the training cells raise a mean, of few cells so far that two targets of equal strength hide each other; they hardly raise a cell in
//! the middle of the order (Rohling 1983). The mean of `Q` over the density of `x_(r)` is a sum over the logarithm of the level, which is smooth, so that steps of a fifth are enough: to
//! 1e-3 of the probability. **Cost** some ten thousand exponentials, once a setup.

/// The factor of the sum of `cells` cells, each of `channels` powers, that another such cell exceeds so rarely.
pub(super) fn averaging(probability: f64, channels: usize, cells: f64) -> f64 {
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

/// The rank of so many cells, from 1.
pub(super) fn place(rank: f64, count: usize) -> usize {
    (libm::ceil(rank * count as f64) as usize).max(1).min(count)
}

/// The factor of the `rank`-th smallest of `count` cells that another such cell exceeds so rarely.
pub(super) fn ordering(probability: f64, channels: usize, count: usize, rank: usize) -> f64 {
    const STEPS: usize = 180;
    const LOWEST: f64 = 1e-12;
    // Beyond, the density is below 1e-15.
    let most = channels as f64 + 12.0 * libm::sqrt(channels as f64) + 40.0;
    let (n, r, shape) = (count as f64, rank as f64, channels as f64);
    let step = libm::log(most / LOWEST) / STEPS as f64;
    let ratio = libm::exp(step);
    // At the middle of each step; the factor that all have in common goes with the total.
    let first = LOWEST * libm::exp(0.5 * step);
    let (mut x, mut total) = (first, 0.0);
    let mut weights = [0.0; STEPS];
    for weight in &mut weights {
        let below = match rank {
            1 => 0.0,
            _ => (r - 1.0) * libm::log(head(channels, x)),
        };
        let own = shape * libm::log(x) - x;
        *weight = libm::exp(below + (n - r) * libm::log(tail(channels, x)) + own + n * shape);
        total += *weight;
        x *= ratio;
    }
    solve(probability, |k| {
        let (mut x, mut sum) = (first, 0.0);
        for weight in &weights {
            sum += weight * tail(channels, k * x);
            x *= ratio;
        }
        sum / total
    })
}

/// `exp(-x) sum_(i < shape) x^i / i!`: how often a Gamma variable is above.
fn tail(shape: usize, x: f64) -> f64 {
    let (mut term, mut sum) = (libm::exp(-x), 0.0);
    for i in 0..shape {
        sum += term;
        term *= x / (i as f64 + 1.0);
    }
    sum
}

/// How often it is below: what [`tail`] leaves, without the rounding of 1.
fn head(shape: usize, x: f64) -> f64 {
    if x > 1.0 {
        return 1.0 - tail(shape, x);
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

/// Where what falls from 1 to 0 has come down to `probability`.
fn solve(probability: f64, falling: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (-30.0, 60.0);
    // To the seventh digit.
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

    /// C (7.8) for one channel, and the known product for ordered cells (Rohling 1983).
    #[test]
    fn factors_are_the_known_ones_of_one_channel() {
        for (probability, cells) in [(1e-2f64, 5), (1e-4, 16), (1e-6, 32)] {
            let n = f64::from(cells);
            let known = libm::pow(probability, -1.0 / n) - 1.0;
            let got = averaging(probability, 1, n);
            assert!((got / known - 1.0).abs() < 1e-6, "{cells}: {got} {known}");
            for rank in [cells / 2, (3 * cells) / 4, cells] {
                let factor = ordering(probability, 1, cells as usize, rank as usize);
                let product = (0..rank).fold(1.0, |product, i| {
                    let left = n - f64::from(i);
                    product * left / (left + factor)
                });
                let off = product / probability - 1.0;
                assert!(off.abs() < 2e-3, "{cells} {rank}: {off}");
            }
        }
    }

    /// Of several channels: the tails of known Gamma distributions, of two channels `exp(-x) (1 + x)`.
    #[test]
    fn both_parts_of_a_gamma_variable_are_one() {
        for x in [1e-6, 0.1, 0.9, 1.1, 4.0] {
            let two = libm::exp(-x) * (1.0 + x);
            assert!((tail(2, x) - two).abs() < 1e-15);
            for shape in [1, 2, 5, 8] {
                assert!((tail(shape, x) + head(shape, x) - 1.0).abs() < 1e-14);
            }
        }
    }
}
