//! Phase deviation of each point: its amplitude dispersion, moderated by the trend over the level.
//!
//! With `nu = N - 1` degrees of freedom, `ln D^2` has the mean `ln s^2 + psi(nu / 2) - ln(nu / 2)` and the variance `psi'(nu / 2)`. Variance beyond that around the
//! trend is spread of the true deviations: a scaled inverse chi-square distribution with `psi'(nu0 / 2)` equal to it.

/// Fewest points from which the slope of the trend is estimated.
const TREND_POINTS: usize = 20;

/// Dispersion of float32 rounding, below which no dispersion is trusted.
const LEAST_DISPERSION: f64 = 1e-7;

/// Phase deviation of each point in one pass, radians, from power and dispersion over `passes`.
pub(super) fn phase_deviations(points: &[(f64, f64)], passes: usize) -> Vec<f64> {
    let own = (passes - 1) as f64;
    let expected = digamma(own / 2.0) - libm::log(own / 2.0);
    let square = |dispersion: f64| {
        let d = dispersion.max(LEAST_DISPERSION);
        d * d
    };
    let logs: Vec<(f64, f64)> = points
        .iter()
        .map(|&(power, dispersion)| (libm::log(power), libm::log(square(dispersion)) - expected))
        .collect();
    let (trend, terms) = trend(&logs);
    let count = logs.len() as f64;
    let residuals = logs.iter().map(|&(x, y)| y - trend(x));
    let spread = residuals.map(|r| r * r).sum::<f64>() / (count - terms).max(1.0);
    let prior = match spread - trigamma(own / 2.0) {
        excess if excess > 0.0 => Some(2.0 * inverse_trigamma(excess)),
        _ => None,
    };
    let deviation = |(&(_, dispersion), &(x, _)): (&(f64, f64), &(f64, f64))| {
        let typical = trend(x);
        let Some(prior) = prior else {
            return libm::exp(typical).sqrt();
        };
        let scale = libm::exp(typical + digamma(prior / 2.0) - libm::log(prior / 2.0));
        let freedom = prior + own;
        let variance = (prior * scale + own * square(dispersion)) / freedom;
        let widened = match freedom > 3.0 {
            true => freedom / (freedom - 2.0),
            false => 3.0,
        };
        (variance * widened).sqrt()
    };
    points.iter().zip(&logs).map(deviation).collect()
}

/// Least-squares line, or the mean of few points, and its number of terms.
fn trend(logs: &[(f64, f64)]) -> (impl Fn(f64) -> f64, f64) {
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|l| l.0), mean(|l| l.1));
    let across: f64 = logs.iter().map(|l| (l.0 - x) * (l.0 - x)).sum();
    let along: f64 = logs.iter().map(|l| (l.0 - x) * (l.1 - y)).sum();
    // Levels that spread by less than 1 dB have no trend.
    let is_line = logs.len() >= TREND_POINTS && across > 0.05 * count;
    let slope = if is_line { along / across } else { 0.0 };
    (
        move |level: f64| y + slope * (level - x),
        if is_line { 2.0 } else { 1.0 },
    )
}

/// Digamma function of a positive argument: recurrence, then the asymptotic series (Abramowitz and Stegun 6.3.18).
fn digamma(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < 10.0 {
        sum -= 1.0 / x;
        x += 1.0;
    }
    let inverse = 1.0 / (x * x);
    sum + libm::log(x)
        - 0.5 / x
        - inverse
            * (1.0 / 12.0 - inverse * (1.0 / 120.0 - inverse * (1.0 / 252.0 - inverse / 240.0)))
}

/// Trigamma function of a positive argument (Abramowitz and Stegun 6.4.12).
fn trigamma(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < 10.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let inverse = 1.0 / (x * x);
    let series = 1.0 / 6.0 - inverse * (1.0 / 30.0 - inverse * (1.0 / 42.0 - inverse / 30.0));
    sum + 1.0 / x + 0.5 * inverse + inverse / x * series
}

/// Argument of a value of the trigamma function, by bisection in its logarithm: the function falls monotonically.
fn inverse_trigamma(value: f64) -> f64 {
    let (mut low, mut high) = (libm::log(1e-4), libm::log(1e6));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match trigamma(libm::exp(middle)) > value {
            true => low = middle,
            false => high = middle,
        }
    }
    libm::exp(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// psi(1) = -gamma, psi(1/2) = -gamma - 2 ln 2, psi'(1) = pi^2 / 6, psi'(1/2) = pi^2 / 2. The series' next term is below 1e-11 from 10 on.
    #[test]
    fn polygamma_functions_have_known_values() {
        let gamma = 0.577_215_664_901_532_9;
        assert!((digamma(1.0) + gamma).abs() < 1e-10);
        assert!((digamma(0.5) + gamma + 2.0 * std::f64::consts::LN_2).abs() < 1e-10);
        let square = std::f64::consts::PI.powi(2);
        assert!((trigamma(1.0) - square / 6.0).abs() < 1e-9);
        assert!((trigamma(0.5) - square / 2.0).abs() < 1e-9);
        assert!((inverse_trigamma(square / 6.0) - 1.0).abs() < 1e-8);
    }
}
