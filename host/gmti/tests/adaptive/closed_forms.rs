//! Probabilities and thresholds against closed forms and direct integration.

use subaperture_gmti::adaptive::{
    AdaptiveError, Performance, Statistic, TargetModel, mean_sinr_loss,
};

fn performance(statistic: Statistic, n: usize, k: usize) -> Performance {
    Performance::new(statistic, n, k).unwrap()
}

#[track_caller]
fn close(got: f64, expected: f64, bound: f64) {
    assert!((got / expected - 1.0).abs() < bound, "{got} {expected}");
}

/// `N = K = 2`: the loss factor has density `2 b` and `L = 1`.
#[test]
fn two_snapshots_of_two_elements_have_closed_forms() {
    for scale in [0.1f64, 3.0, 400.0, 1e5] {
        let amf = 2.0 * (scale - scale.ln_1p()) / (scale * scale);
        let got = performance(Statistic::Amf, 2, 2).false_alarm_probability(scale);
        close(got, amf, 1e-10);
        let ace = 2.0 * ((1.0 + 1.0 / scale) * scale.ln_1p() / scale - 1.0 / scale);
        let threshold = scale / (1.0 + scale);
        close(
            performance(Statistic::Ace, 2, 2).false_alarm_probability(threshold),
            ace,
            1e-10,
        );
        let kelly = performance(Statistic::Kelly, 2, 2).false_alarm_probability(threshold);
        close(kelly, 1.0 / (1.0 + scale), 1e-10);
    }
}

/// Integral of a function over 0 to 1 by Simpson's rule with this many steps, after `b = v^3 (10 - 15 v + 6 v^2)`, which resolves peaks at both ends.
fn integral(steps: usize, function: impl Fn(f64) -> f64) -> f64 {
    let term = |i: usize| {
        let v = i as f64 / steps as f64;
        let weight = match i {
            _ if i == 0 || i == steps => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let slope = 30.0 * (v * (1.0 - v)).powi(2);
        weight * slope * function(v.powi(3) * (10.0 - v * (15.0 - 6.0 * v)))
    };
    (0..=steps).map(term).sum::<f64>() / (3.0 * steps as f64)
}

/// Density of the loss factor from factorials: `K! / ((K - N + 1)! (N - 2)!) b^(K - N + 1) (1 - b)^(N - 2)`.
fn density(n: usize, k: usize, b: f64) -> f64 {
    let factorial = |m: usize| (1..=m).map(|i| i as f64).product::<f64>();
    let scale = factorial(k) / (factorial(k - n + 1) * factorial(n - 2));
    scale * b.powi((k - n + 1) as i32) * (1.0 - b).powi((n - 2) as i32)
}

#[test]
fn quadrature_agrees_with_direct_integration() {
    for (n, k) in [
        (2, 8),
        (3, 12),
        (6, 18),
        (6, 9),
        (16, 32),
        (16, 150),
        (2, 100),
    ] {
        let l = (k - n + 1) as i32;
        for probability in [1e-2, 1e-4, 1e-6] {
            let law = performance(Statistic::Amf, n, k);
            let eta = law.threshold(probability).unwrap();
            let expected = integral(200_000, |b| density(n, k, b) * (1.0 + eta * b).powi(-l));
            close(law.false_alarm_probability(eta), expected, 1e-6);
            close(expected, probability, 1e-6);
            let snr = 20.0;
            let target = |b: f64| (1.0 + eta * b / (1.0 + snr * b)).powi(-l);
            let expected = integral(200_000, |b| density(n, k, b) * target(b));
            close(
                law.detection_probability(eta, snr, TargetModel::Swerling1),
                expected,
                1e-6,
            );

            let law = performance(Statistic::Ace, n, k);
            let eta = law.threshold(probability).unwrap();
            let odds = eta / (1.0 - eta);
            let expected = integral(200_000, |b| {
                density(n, k, b) * (1.0 + odds * (1.0 - b)).powi(-l)
            });
            close(expected, probability, 1e-6);
            let target = |b: f64| (1.0 + odds * (1.0 - b) / (1.0 + snr * b)).powi(-l);
            let expected = integral(200_000, |b| density(n, k, b) * target(b));
            close(
                law.detection_probability(eta, snr, TargetModel::Swerling1),
                expected,
                1e-6,
            );
        }
    }
}

/// Probability that a Gamma variable of shape `1 + j`, `j` Poisson of mean `snr`, exceeds `g` times one of shape `l`: at most `j` arrivals of one process precede the `l`-th of another.
fn steady_exceedance(snr: f64, g: f64, l: usize) -> f64 {
    let (mut arrivals, mut below) = ((1.0 + g).powi(-(l as i32)), 0.0);
    let (mut weight, mut sum) = ((-snr).exp(), 0.0);
    for j in 0..300 {
        below += arrivals;
        sum += weight * below;
        let next = (j + 1) as f64;
        arrivals *= (l + j) as f64 / next * g / (1.0 + g);
        weight *= snr / next;
    }
    sum
}

#[test]
fn steady_targets_agree_with_direct_integration() {
    for (n, k) in [(2, 8), (6, 9), (6, 18), (16, 150)] {
        for snr in [0.5, 20.0, 60.0] {
            let probability = |statistic, conditional: &dyn Fn(f64, f64) -> f64| {
                let law = performance(statistic, n, k);
                let eta = law.threshold(1e-4).unwrap();
                let target = |b| steady_exceedance(snr * b, conditional(eta, b), k - n + 1);
                let expected = integral(4000, |b| density(n, k, b) * target(b));
                let got = law.detection_probability(eta, snr, TargetModel::Swerling0);
                close(got, expected, 1e-6);
            };
            probability(Statistic::Amf, &|eta, b| eta * b);
            probability(Statistic::Kelly, &|eta, _| eta / (1.0 - eta));
            probability(Statistic::Ace, &|eta, b| eta / (1.0 - eta) * (1.0 - b));
        }
    }
}

#[test]
fn thresholds_invert_probabilities() {
    use Statistic::{Ace, Amf, Kelly, MatchedFilter};
    for statistic in [MatchedFilter, Amf, Kelly, Ace] {
        for (n, k) in [(2, 2), (2, 8), (6, 18), (16, 40), (16, 1000), (40, 10_000)] {
            let law = performance(statistic, n, k);
            for probability in [0.9, 1e-3, 1e-8] {
                let threshold = law.threshold(probability).unwrap();
                close(law.false_alarm_probability(threshold), probability, 1e-6);
                for target in [TargetModel::Swerling0, TargetModel::Swerling1] {
                    let absent = law.detection_probability(threshold, 0.0, target);
                    assert!(
                        (absent - probability).abs() < 1e-9,
                        "{absent} {probability}"
                    );
                }
            }
            for invalid in [0.0, 1.0, -0.1, f64::NAN] {
                assert!(matches!(
                    law.threshold(invalid),
                    Err(AdaptiveError::Probability(_))
                ));
            }
            assert_eq!(law.false_alarm_probability(0.0), 1.0);
        }
    }
    assert_eq!(performance(Ace, 2, 8).false_alarm_probability(1.0), 0.0);
    // With one degree of freedom AMF is cell averaging: the multiplier of the sum is Pfa^(-1/K) - 1.
    let cell_averaging = performance(Amf, 1, 16).threshold(1e-4).unwrap();
    close(cell_averaging, 1e4f64.powf(1.0 / 16.0) - 1.0, 1e-12);
    for (statistic, n, k) in [(Amf, 3, 2), (Kelly, 0, 2), (Ace, 1, 8)] {
        let error = Performance::new(statistic, n, k).unwrap_err();
        assert!(matches!(error, AdaptiveError::Training { .. }), "{error}");
    }
}

/// 13.2 dB for Pd 0.9 and Pfa 1e-6 is the textbook case of a steady target; 21.1 dB of a Swerling 1 target (Skolnik).
#[test]
fn known_covariance_has_textbook_detection_probabilities() {
    let law = performance(Statistic::MatchedFilter, 1, 1);
    let threshold = law.threshold(1e-6).unwrap();
    close(threshold, 13.815_510_557_964_274, 1e-14);
    for (target, snr_db) in [
        (TargetModel::Swerling0, 13.2),
        (TargetModel::Swerling1, 21.15),
    ] {
        let snr = 10f64.powf(snr_db / 10.0);
        let got = law.detection_probability(threshold, snr, target);
        assert!((got - 0.9).abs() < 0.005, "{got}");
    }
    // Many snapshots approach a known covariance.
    for statistic in [Statistic::Amf, Statistic::Kelly] {
        let adaptive = performance(statistic, 3, 20_000);
        let threshold = adaptive.threshold(1e-6).unwrap();
        let snr = 10f64.powf(1.32);
        let got = adaptive.detection_probability(threshold, snr, TargetModel::Swerling0);
        assert!((got - 0.9).abs() < 0.01, "{statistic:?}: {got}");
    }
    // ACE of a known covariance compares |z|^2 with a Gamma variable of shape N - 1 = 1: Pfa = 1 - eta, and for a Swerling 1 target Pd = 1 / (1 + odds / (1 + snr)).
    let ace = performance(Statistic::Ace, 2, 20_000);
    let threshold = ace.threshold(1e-2).unwrap();
    close(1.0 - threshold, 1e-2, 2e-3);
    let got = ace.detection_probability(threshold, 50.0, TargetModel::Swerling1);
    close(got, 1.0 / (1.0 + 99.0 / 51.0), 2e-3);
    assert_eq!(mean_sinr_loss(6, 9), 0.5);
    assert_eq!(mean_sinr_loss(1, 8), 1.0);
}
