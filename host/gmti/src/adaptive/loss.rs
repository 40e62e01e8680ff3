//! Loss factor of an estimated covariance (Reed, Mallett, Brennan 1974) and expectations over it.

/// Mean SINR loss `(K + 2 - N) / (K + 1)` of `K` snapshots and `N` degrees of freedom: a power ratio, 1/2 (3 dB) at `K = 2 N - 3`.
///
/// It is the mean of the RMB distribution `Beta(K - N + 2, N - 1)` of [`Whitener::sinr_loss`](super::Whitener::sinr_loss).
///
/// # Panics
/// If `degrees_of_freedom` is 0 or exceeds `snapshots`.
pub fn mean_sinr_loss(degrees_of_freedom: usize, snapshots: usize) -> f64 {
    assert!((1..=snapshots).contains(&degrees_of_freedom));
    (snapshots + 2 - degrees_of_freedom) as f64 / (snapshots + 1) as f64
}

/// Loss factor with its complement, which is accurate for factors near 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct LossFactor {
    pub(super) value: f64,
    /// Difference of the factor from 1.
    pub(super) complement: f64,
}

/// Expectation of `function` over the loss factor `b`, of distribution `Beta(K - N + 2, N - 1)`.
///
/// The trapezoidal rule over `y = ln(b / (1 - b))`, with the density `b^p (1 - b)^q / B(p, q)` over `y`, `p = K - N + 2`, `q = N - 1`. The integrand must be 0 or more and have one peak, and be analytic
/// near the real axis: functions such as `(1 + g b)^-(K - N + 1)` are so for `|Im y| < pi`. The step is halved until the change is below 1e-9 of the result; the error then is about the square of that change, as the rule
/// converges exponentially.
pub(super) fn expectation(
    degrees_of_freedom: usize,
    snapshots: usize,
    function: impl Fn(LossFactor) -> f64,
) -> f64 {
    const CHANGE: f64 = 1e-9;
    const HALVINGS: usize = 12;
    if degrees_of_freedom == 1 {
        return function(LossFactor {
            value: 1.0,
            complement: 0.0,
        });
    }
    let (p, q) = (
        (snapshots + 2 - degrees_of_freedom) as f64,
        (degrees_of_freedom - 1) as f64,
    );
    let log_scale = libm::lgamma(p + q) - libm::lgamma(p) - libm::lgamma(q);
    let mode = libm::log(p / q);
    let term = |offset: f64| {
        let odds = libm::exp(mode + offset);
        let (log_value, log_complement) = (-libm::log1p(1.0 / odds), -libm::log1p(odds));
        let density = libm::exp(log_scale + p * log_value + q * log_complement);
        let factor = LossFactor {
            value: 1.0 / (1.0 + 1.0 / odds),
            complement: 1.0 / (1.0 + odds),
        };
        (density, density * function(factor))
    };
    let mut step = 0.5;
    let mut result = step * sum(step, 0.0, term);
    for _ in 0..HALVINGS {
        let halved = 0.5 * (result + step * sum(step, 0.5 * step, term));
        let change = (halved - result).abs();
        (result, step) = (halved, 0.5 * step);
        if change <= CHANGE * result {
            break;
        }
    }
    result
}

/// Sum of the values at `first`, `first + step`, ... and `first - step`, ..., up to negligible ones beyond the peak. `term` returns the density, which ends the sum where it is 0, and the value.
fn sum(step: f64, first: f64, term: impl Fn(f64) -> (f64, f64)) -> f64 {
    const NEGLIGIBLE: f64 = 1e-17;
    let mut sum = 0.0;
    for (start, step) in [(first, step), (first - step, -step)] {
        let (mut offset, mut last) = (start, f64::INFINITY);
        loop {
            let (density, value) = term(offset);
            sum += value;
            if density == 0.0 || (value < NEGLIGIBLE * sum && value <= last) {
                break;
            }
            last = value;
            offset += step;
        }
    }
    sum
}
