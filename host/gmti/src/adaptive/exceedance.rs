//! Exceedance probabilities of a complex Gaussian's power over fixed and Gamma distributed levels.

/// Probability that `|z|^2` exceeds `level`, for complex Gaussian `z` of variance 1 and mean square `snr`: Marcum's `Q_1(sqrt(2 snr), sqrt(2 level))`.
///
/// `|z|^2` is a Gamma variable of shape `1 + j`, `j` being Poisson of mean `snr`: `Q_1 = sum_j pois(j; snr) sum_(i <= j) pois(i; level)`. All terms are positive.
pub(super) fn marcum_q(snr: f64, level: f64) -> f64 {
    // Beyond this distance of amplitudes, in units of 1, a miss has a probability below exp(-49).
    const CERTAIN: f64 = 7.0;
    // Below the smallest float64.
    const IMPOSSIBLE: f64 = 28.0;
    let apart = snr.sqrt() - level.sqrt();
    if apart > CERTAIN {
        return 1.0;
    }
    if apart < -IMPOSSIBLE {
        return 0.0;
    }
    let last = snr + 12.0 * snr.sqrt() + 40.0;
    let [mut weight, mut tail] = [Poisson::new(snr), Poisson::new(level)];
    let (mut below, mut sum, mut total) = (0.0, 0.0, 0.0);
    while weight.count <= last {
        below += tail.next();
        let weight = weight.next();
        sum += weight * below;
        total += weight;
    }
    // Rounding of the logarithms is common to both.
    (sum / total).min(1.0)
}

/// Probability that `|z|^2` exceeds `scale` times a Gamma variable of integer `shape`, for `z` as in [`marcum_q`].
///
/// Kelly 1986: `sum_(m = 0)^L binom(L, m) g^m / (1 + g)^L P(j >= m)`, with `g` the scale, `L` the shape and `j` Poisson of mean `snr / (1 + g)`. The sum descends from large `m`: all terms are positive, so that
/// small probabilities keep their relative accuracy.
pub(super) fn gamma_exceedance(snr: f64, scale: f64, shape: usize) -> f64 {
    if scale == f64::INFINITY {
        return 0.0;
    }
    let (mean, count) = (snr / (1.0 + scale), shape as f64);
    if mean == 0.0 || scale == 0.0 {
        return exponential_exceedance(scale, shape);
    }
    let (log_mean, log_scale) = (libm::log(mean), libm::log(scale));
    let mut j = (count.max(mean) + 12.0 * mean.sqrt() + 40.0).floor();
    let mut log_poisson = j * log_mean - mean - libm::lgamma(j + 1.0);
    let mut log_weight = -count * libm::log1p(1.0 / scale);
    let (mut survival, mut sum) = (0.0, 0.0);
    while j >= 0.0 {
        survival += libm::exp(log_poisson);
        log_poisson += libm::log(j) - log_mean;
        if j <= count {
            sum += libm::exp(log_weight) * survival;
            log_weight += libm::log(j / (count - j + 1.0)) - log_scale;
        }
        j -= 1.0;
    }
    sum.min(1.0)
}

/// Probability that an exponential variable of mean 1 exceeds `scale` times a Gamma variable of this shape: `(1 + scale)^-shape`.
pub(super) fn exponential_exceedance(scale: f64, shape: usize) -> f64 {
    libm::exp(-(shape as f64) * libm::log1p(scale))
}

/// Poisson probabilities of 0, 1, 2 and so on, from logarithms: means above 745 have terms below the smallest float64.
struct Poisson {
    log_mean: f64,
    count: f64,
    log_term: f64,
}

impl Poisson {
    fn new(mean: f64) -> Self {
        Self {
            log_mean: libm::log(mean),
            count: 0.0,
            log_term: -mean,
        }
    }

    fn next(&mut self) -> f64 {
        let term = libm::exp(self.log_term);
        self.count += 1.0;
        self.log_term += self.log_mean - libm::log(self.count);
        term
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rice's density `2 r exp(-r^2 - snr) I_0(2 r sqrt(snr))`, with `I_0` by its integral over an angle.
    fn rice_tail(snr: f64, level: f64) -> f64 {
        const ANGLES: usize = 400;
        const STEPS: usize = 8000;
        let (first, span) = (level.sqrt(), 10.0);
        let density = |r: f64| {
            let angle = |i: usize| (std::f64::consts::TAU * i as f64 / ANGLES as f64).cos();
            let terms = (0..ANGLES).map(|i| (2.0 * r * snr.sqrt() * angle(i) - r * r - snr).exp());
            2.0 * r * terms.sum::<f64>() / ANGLES as f64
        };
        let step = span / STEPS as f64;
        let simpson = |i: usize| match i {
            0 | STEPS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let terms = (0..=STEPS).map(|i| simpson(i) * density(first + i as f64 * step));
        terms.sum::<f64>() * step / 3.0
    }

    #[test]
    fn marcum_q_is_the_tail_of_the_rice_density() {
        for (snr, level) in [
            (0.0, 3.0),
            (1.0, 4.6),
            (13.0, 13.8),
            (30.0, 9.2),
            (10.0, 60.0),
        ] {
            let (got, expected) = (marcum_q(snr, level), rice_tail(snr, level));
            assert!(
                (got / expected - 1.0).abs() < 1e-9,
                "{snr} {level}: {got} {expected}"
            );
        }
        assert_eq!(marcum_q(1e6, 20.0), 1.0);
        assert_eq!(marcum_q(0.0, 900.0), 0.0);
        // Near the median both tails are a half, up to 1 / (4 sqrt(pi snr)).
        assert!(
            (marcum_q(1e4, 1e4) - 0.5 - 0.25 / (1e4 * std::f64::consts::PI).sqrt()).abs() < 1e-4
        );
    }

    #[test]
    fn gamma_exceedance_without_signal_is_the_exponential_one() {
        for (scale, shape) in [(0.3, 7), (2.0, 13), (40.0, 1), (1e-3, 5000)] {
            let expected = exponential_exceedance(scale, shape);
            let got = gamma_exceedance(0.0, scale, shape);
            assert!((got / expected - 1.0).abs() < 1e-11, "{got} {expected}");
        }
        // Many snapshots approach a known covariance.
        let (got, expected) = (
            gamma_exceedance(9.0, 9.2 / 1e5, 100_000),
            marcum_q(9.0, 9.2),
        );
        assert!((got - expected).abs() < 1e-3, "{got} {expected}");
    }
}
