//! Sums, factors, weights and statistics of small hand-computed cases.

use num_complex::{Complex32, Complex64};
use subaperture_gmti::adaptive::{
    AdaptiveError, Covariance, Detector, Loading, Statistic, Whitener,
};

use crate::noise::{CLUTTER, random, steering};

fn c(re: f64, im: f64) -> Complex64 {
    Complex64::new(re, im)
}

/// `S = [[4, 2i], [-2i, 5]]`, determinant 16, inverse `[[5, -2i], [2i, 4]] / 16`.
fn small() -> Whitener {
    Whitener::known(2, &[c(4.0, 0.0), c(0.0, 2.0), c(0.0, -2.0), c(5.0, 0.0)]).unwrap()
}

#[test]
fn two_by_two_matrix_agrees_with_its_inverse() {
    let (s, x) = ([c(1.0, 0.0), c(0.0, 1.0)], [c(2.0, 0.0), c(0.0, 0.0)]);
    let whitener = small();
    // S^-1 s = (5 + 2, 2i + 4i) / 16.
    let mut weights = [Complex64::ZERO; 2];
    whitener.weights(&s, &mut weights);
    assert!((weights[0] - c(7.0 / 16.0, 0.0)).norm() < 1e-15);
    assert!((weights[1] - c(0.0, 6.0 / 16.0)).norm() < 1e-15);
    // s^H S^-1 s = 13 / 16, x^H S^-1 x = 20 / 16, s^H S^-1 x = 14 / 16.
    let form = |a, b| whitener.quadratic_form::<f64>(a, b);
    assert!((form(&s, &s) - 13.0 / 16.0).norm() < 1e-15);
    assert!((form(&x, &x) - 20.0 / 16.0).norm() < 1e-15);
    assert!((form(&s, &x) - 14.0 / 16.0).norm() < 1e-15);
    let mut whitened = [Complex64::ZERO; 2];
    whitener.whiten(&x, &mut whitened);
    assert!((whitened[0] - 1.0).norm() < 1e-15);
    assert!((whitened[1] - c(0.0, 0.5)).norm() < 1e-15);

    let amf = 14.0 * 14.0 / (16.0 * 13.0);
    let mut detector = Detector::new(whitener, &s).unwrap();
    for (statistic, expected) in [
        (Statistic::MatchedFilter, amf),
        (Statistic::Amf, amf),
        (Statistic::Kelly, amf / (1.0 + 1.25)),
        (Statistic::Ace, amf / 1.25),
    ] {
        let got = detector.evaluate(statistic, &x).value;
        assert!(
            (got - expected).abs() < 1e-15,
            "{statistic:?}: {got} {expected}"
        );
    }
}

/// `R = I`: `s^H R^-1 s = 2`, `|S^-1 s|^2 = (49 + 36) / 256`, so the loss is `(13 / 16)^2 / (85 / 256 * 2) = 169 / 170`.
#[test]
fn sinr_loss_of_a_small_case() {
    let identity = [
        Complex64::ONE,
        Complex64::ZERO,
        Complex64::ZERO,
        Complex64::ONE,
    ];
    let identity = Whitener::known(2, &identity).unwrap();
    let s = [c(1.0, 0.0), c(0.0, 1.0)];
    assert!((small().sinr_loss(&s, &identity) - 169.0 / 170.0).abs() < 1e-14);
    assert!((small().sinr_loss(&s, &small()) - 1.0).abs() < 1e-14);
}

#[test]
fn sliding_window_equals_a_new_sum() {
    let mut random = random(1, 0);
    let snapshots: Vec<[Complex64; 3]> = (0..20)
        .map(|_| {
            let mut cell = [Complex64::ZERO; 3];
            CLUTTER.sample(&mut random, &mut cell);
            cell
        })
        .collect();
    let sum = |snapshots: &[[Complex64; 3]]| {
        let mut sum = Covariance::new(3);
        snapshots.iter().for_each(|x| sum.add(x));
        sum
    };
    let mut sliding = sum(&snapshots[..12]);
    for (entering, leaving) in snapshots[12..].iter().zip(&snapshots) {
        sliding.add(entering);
        sliding.subtract(leaving);
    }
    assert_eq!(sliding.snapshots(), 12);
    let s = steering(3, 1.0);
    let form = |sum: &Covariance| sum.factor(Loading::Off).unwrap().quadratic_form(&s, &s);
    let (slid, new) = (form(&sliding), form(&sum(&snapshots[8..])));
    assert!((slid - new).norm() < 1e-12 * new.norm());
    sliding.clear();
    assert_eq!(sliding, Covariance::new(3));
    // Float32 snapshots are widened without rounding.
    let narrow = [Complex32::new(0.5, -2.0), Complex32::new(1.0, 0.25)];
    let (mut a, mut b) = (Covariance::new(2), Covariance::new(2));
    a.add(&narrow);
    b.add(&[c(0.5, -2.0), c(1.0, 0.25)]);
    assert_eq!(a, b);
}

/// Two snapshots `(2, 0)` and one `(0, 2)`: `S = diag(8, 4)`, mean covariance `diag(8, 4) / 3`.
#[test]
fn loading_adds_to_the_diagonal_of_the_mean_covariance() {
    let mut sum = Covariance::new(2);
    for x in [[2.0, 0.0], [2.0, 0.0], [0.0, 2.0]] {
        sum.add(&x.map(|re| c(re, 0.0)));
    }
    let s = [Complex64::ONE, Complex64::ZERO];
    for (loading, diagonal) in [
        (Loading::Absolute(0.5), 8.0 + 3.0 * 0.5),
        (Loading::Relative(0.5), 8.0 + 0.5 * 6.0),
    ] {
        let form = sum.factor(loading).unwrap().quadratic_form(&s, &s);
        assert!((form - 1.0 / diagonal).norm() < 1e-15);
    }
}

#[test]
fn invalid_training_is_refused() {
    let mut sum = Covariance::new(2);
    let refused = |sum: &Covariance, loading| sum.factor(loading).unwrap_err();
    let too_few = |snapshots, required| AdaptiveError::Snapshots {
        snapshots,
        degrees_of_freedom: 2,
        required,
    };
    assert_eq!(refused(&sum, Loading::Absolute(1.0)), too_few(0, 1));
    (0..3).for_each(|_| sum.add(&[Complex64::ONE; 2]));
    assert_eq!(refused(&sum, Loading::Off), too_few(3, 4));
    let text = refused(&sum, Loading::Off).to_string();
    assert!(
        text.contains("at least 4 training snapshots for 2 degrees of freedom, found 3"),
        "{text}"
    );
    sum.add(&[Complex64::ONE; 2]);
    let singular = refused(&sum, Loading::Off);
    assert!(
        matches!(singular, AdaptiveError::NotPositiveDefinite { row: 1, .. }),
        "{singular}"
    );
    for level in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(&sum, Loading::Relative(level));
        assert!(matches!(error, AdaptiveError::Loading(_)), "{error}");
    }
    assert!(sum.factor(Loading::Relative(1e-6)).is_ok());

    let mut detector = Detector::new(small(), &steering(2, 1.0)).unwrap();
    assert!(detector.train(&sum, Loading::Off).is_err());
    let below_any_threshold = |value: f64| value.is_nan() || value < 0.0;
    let value = detector
        .evaluate(Statistic::Amf, &[Complex64::ONE; 2])
        .value;
    assert!(below_any_threshold(value), "{value}");
    let mut detector = Detector::new(small(), &steering(2, 1.0)).unwrap();
    for statistic in [Statistic::Amf, Statistic::Kelly, Statistic::Ace] {
        let cell = [c(f64::NAN, 0.0), Complex64::ONE];
        let value = detector.evaluate(statistic, &cell).value;
        assert!(below_any_threshold(value), "{statistic:?}: {value}");
    }
    sum.add(&[c(f64::NAN, 0.0), Complex64::ONE]);
    let error = refused(&sum, Loading::Off);
    assert!(
        matches!(error, AdaptiveError::NotPositiveDefinite { row: 0, .. }),
        "{error}"
    );
}

#[test]
fn steering_vectors_must_be_whole_finite_and_nonzero() {
    let invalid_of = |steering: &[Complex64]| match Detector::new(small(), steering) {
        Err(AdaptiveError::Steering { invalid, .. }) => Some(invalid),
        _ => None,
    };
    assert_eq!(invalid_of(&[]), Some(0));
    assert_eq!(invalid_of(&[Complex64::ONE; 3]), Some(1));
    let one = [Complex64::ONE; 2];
    assert_eq!(
        invalid_of(&[one, one, [Complex64::ZERO; 2]].concat()),
        Some(2)
    );
    assert_eq!(invalid_of(&[one, [c(f64::NAN, 0.0); 2]].concat()), Some(1));
    assert_eq!(invalid_of(&[one, one].concat()), None);
}

#[test]
fn maximum_over_steering_vectors_is_at_the_target() {
    const N: usize = 4;
    let steps = [-2.0, -1.0, 0.0, 1.0, 2.0];
    // Norms of the steering vectors do not matter.
    let grid = steps.map(|step| steering(N, step).into_iter().map(move |s| s * (3.0 + step)));
    let grid: Vec<Complex64> = grid.into_iter().flatten().collect();
    let known = Whitener::known(N, &CLUTTER.matrix(N)).unwrap();
    let mut detector = Detector::new(known, &grid).unwrap();
    for (index, step) in steps.into_iter().enumerate() {
        let cell = steering(N, step);
        for statistic in [
            Statistic::MatchedFilter,
            Statistic::Amf,
            Statistic::Kelly,
            Statistic::Ace,
        ] {
            assert_eq!(detector.evaluate(statistic, &cell).index, index);
        }
        let value = detector.evaluate(Statistic::MatchedFilter, &cell).value;
        assert!((value / CLUTTER.snr(&cell) - 1.0).abs() < 1e-12);
        assert!((detector.evaluate(Statistic::Ace, &cell).value - 1.0).abs() < 1e-12);
    }
    assert_eq!(
        detector
            .evaluate(Statistic::Ace, &[Complex64::ZERO; N])
            .value,
        0.0
    );
}
