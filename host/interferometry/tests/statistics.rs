//! Distribution of the sample coherence against the published density, quadrature and counting.

mod speckle;

use speckle::{Random, image_of, pair};
use subaperture_interferometry::{
    CoherenceDistribution, InterferometryError, MAX_COHERENCE, coherence_of_median, interferogram,
};

/// Density of Touzi et al. 1999 with Euler's transformation, `2F1(L, L; 1; x) = (1 - x)^(1 - 2 L) 2F1(1 - L, 1 - L; 1; x)`, by logarithms: for whole `L` a polynomial of positive terms.
fn published_density(d: f64, coherence: f64, looks: f64) -> f64 {
    let x = d * d * coherence * coherence;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 0.0);
    loop {
        let next = (1.0 - looks + k) / (k + 1.0);
        term *= next * next * x;
        if term < 1e-18 * sum {
            break;
        }
        sum += term;
        k += 1.0;
    }
    let log = looks * (1.0 - coherence * coherence).ln()
        + (looks - 2.0) * (1.0 - d * d).ln()
        + (1.0 - 2.0 * looks) * (1.0 - x).ln()
        + sum.ln();
    2.0 * (looks - 1.0) * d * log.exp()
}

/// Simpson's rule with `2 n` intervals.
fn integral(of: impl Fn(f64) -> f64, from: f64, to: f64, n: usize) -> f64 {
    let step = (to - from) / (2 * n) as f64;
    let weight = |i: usize| match i {
        0 => 1.0,
        i if i == 2 * n => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=2 * n)
        .map(|i| weight(i) * of(from + step * i as f64))
        .sum::<f64>()
        * step
        / 3.0
}

const CASES: [(f64, f64); 8] = [
    (0.0, 2.5),
    (0.3, 4.0),
    (0.5, 9.0),
    (0.8, 3.7),
    (0.8, 16.4),
    (0.95, 30.0),
    (0.99, 100.0),
    (0.999, 200.0),
];

#[test]
fn density_is_that_of_touzi() {
    for (coherence, looks) in CASES {
        let distribution = CoherenceDistribution::new(coherence, looks).unwrap();
        let centre = distribution.mean();
        // Over four standard deviations of the Fisher transformed coherence.
        let spread = 4.0 * (1.0 - coherence * coherence) / (2.0 * looks).sqrt();
        for i in 0..=20 {
            let d = (centre + spread * (f64::from(i) / 10.0 - 1.0)).clamp(0.01, 0.9999);
            let published = published_density(d, coherence, looks);
            let density = distribution.density(d);
            assert!(
                (density - published).abs() <= 1e-9 * published + 1e-12,
                "{coherence} {looks} {d}: {density} {published}"
            );
        }
        assert_eq!(
            [distribution.density(0.0), distribution.density(1.0)],
            [0.0; 2]
        );
    }
}

#[test]
fn probabilities_and_mean_are_integrals_of_the_published_density() {
    for (coherence, looks) in CASES {
        let distribution = CoherenceDistribution::new(coherence, looks).unwrap();
        let density = |d: f64| match d {
            d if d <= 0.0 || d >= 1.0 => 0.0,
            d => published_density(d, coherence, looks),
        };
        for probability in [1e-6, 1e-3, 0.01, 0.3, 0.5, 0.9] {
            let t = distribution.threshold(probability).unwrap();
            // The lower tail falls by more than 1e-9 of the probability over 30 standard deviations.
            let spread = (1.0 - coherence * coherence) / (2.0 * looks).sqrt();
            let integral = integral(density, (t - 30.0 * spread).max(0.0), t, 20_000);
            assert!(
                (integral / probability - 1.0).abs() < 1e-6,
                "{coherence} {looks} {probability}: {integral}"
            );
            assert!((distribution.probability_below(t) / probability - 1.0).abs() < 1e-6);
        }
        // With d = sin(u) the density is smooth at 1 for looks of 1.5 and more.
        let mean = integral(
            |u| density(u.sin()) * u.sin() * u.cos(),
            0.0,
            std::f64::consts::FRAC_PI_2,
            200_000,
        );
        assert!(
            (distribution.mean() - mean).abs() < 1e-8,
            "{coherence} {looks}: {} {mean}",
            distribution.mean()
        );
        assert!(distribution.mean() > coherence);
    }
}

/// Touzi et al. 1999: for a coherence of 0, the mean is `Gamma(L) Gamma(3/2) / Gamma(L + 1/2)`, here by products for whole `L`.
#[test]
fn bias_of_incoherent_images_is_the_published_one() {
    for looks in [2u32, 4, 9, 25] {
        let product: f64 = (1..looks)
            .map(|k| f64::from(k) / (f64::from(k) + 0.5))
            .product();
        let mean = CoherenceDistribution::new(0.0, looks.into())
            .unwrap()
            .mean();
        assert!((mean - product).abs() < 1e-12, "{looks}: {mean} {product}");
    }
}

#[test]
fn median_inverts_to_its_coherence() {
    for (coherence, looks) in CASES {
        let median = CoherenceDistribution::new(coherence, looks)
            .unwrap()
            .threshold(0.5)
            .unwrap();
        let inverted = coherence_of_median(median, looks).unwrap();
        // The median is flat in the coherence near 0.
        let tolerance = if coherence == 0.0 { 1e-4 } else { 1e-8 };
        assert!(
            (inverted - coherence).abs() < tolerance,
            "{coherence} {looks}: {inverted}"
        );
    }
    assert_eq!(coherence_of_median(0.01, 9.0).unwrap(), 0.0);
    assert_eq!(coherence_of_median(1.0, 9.0).unwrap(), MAX_COHERENCE);
}

#[test]
fn invalid_parameters_are_refused() {
    use InterferometryError::{Coherence, Looks, Probability};
    for coherence in [-0.1, 1.0, f64::NAN] {
        assert!(matches!(
            CoherenceDistribution::new(coherence, 9.0),
            Err(Coherence(_))
        ));
    }
    for looks in [1.0, 0.0, 1e6, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            CoherenceDistribution::new(0.5, looks),
            Err(Looks(_))
        ));
    }
    let distribution = CoherenceDistribution::new(0.5, 9.0).unwrap();
    for probability in [0.0, 1.0, -1.0, f64::NAN] {
        assert!(matches!(
            distribution.threshold(probability),
            Err(Probability(_))
        ));
    }
    assert!(coherence_of_median(f64::NAN, 9.0).is_err());
}

/// Counted over 10^6 windows of 3 x 3 independent pixels that do not overlap. With a probability of 1e-2, 10^4 are expected with a standard deviation of 1 %:
/// four of them are allowed.
#[test]
fn false_alarms_agree_with_theory_at_three_coherences() {
    let (side, cells) = (3000, 1000);
    for (coherence, changed) in [(0.5, 0.1), (0.8, 0.3), (0.95, 0.6)] {
        let distribution = CoherenceDistribution::new(coherence, 9.0).unwrap();
        let threshold = distribution.threshold(1e-2).unwrap();
        let count = |coherence: f64, rows: usize, seed: u64| {
            let [a, b] = pair(&mut Random(seed), rows * side, coherence);
            let size = [rows, side];
            let formed = interferogram(&image_of(size, &a), &image_of(size, &b), [3, 3]).unwrap();
            let magnitude = formed.magnitude();
            let centres =
                (0..rows / 3).flat_map(|r| (0..cells).map(move |c| [3 * r + 1, 3 * c + 1]));
            let below =
                centres.filter(|[r, c]| f64::from(magnitude.values[r * side + c]) < threshold);
            below.count() as f64
        };
        let ratio = count(coherence, side, (100.0 * coherence) as u64) / 1e4;
        println!("coherence {coherence}: false alarms over theory {ratio:.4}");
        assert!((ratio - 1.0).abs() < 0.04, "{coherence}: {ratio}");
        // Detections of 10^5 changed windows: binomial.
        let detected = count(changed, side / 10, 2) / 1e5;
        let theory = CoherenceDistribution::new(changed, 9.0)
            .unwrap()
            .probability_below(threshold);
        let deviation = (theory * (1.0 - theory) / 1e5).sqrt();
        assert!(
            (detected - theory).abs() < 4.0 * deviation,
            "{changed}: {detected} {theory}"
        );
    }
}
