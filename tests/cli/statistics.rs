//! Statistics of times in the benchmark program.

use subaperture_tests::statistics::{exponent, fastest_within, is_slower, quartiles};

#[test]
fn exponent_is_that_of_power_law() {
    let points = [1.0, 2.0, 4.0, 8.0].map(|x: f64| (x, 3.0 * x.powf(1.7)));
    assert!((exponent(&points).unwrap() - 1.7).abs() < 1e-12);
    // Logarithms 0, 0 and 1 over 0, 1 and 2: a slope of a half.
    let e = std::f64::consts::E;
    let bent = [(1.0, 1.0), (e, 1.0), (e * e, e)];
    assert!((exponent(&bent).unwrap() - 0.5).abs() < 1e-12);
    assert_eq!(exponent(&points[..1]), None);
    assert_eq!(exponent(&[]), None);
}

#[test]
fn quartiles_lie_between_sorted_values() {
    assert_eq!(quartiles(&[5.0, 1.0, 3.0, 2.0, 4.0]), Some([2.0, 3.0, 4.0]));
    assert_eq!(quartiles(&[2.0, 1.0]), Some([1.25, 1.5, 1.75]));
    assert_eq!(quartiles(&[7.0]), Some([7.0; 3]));
    assert_eq!(quartiles(&[]), None);
}

#[test]
fn times_spread_about_limit_are_not_slower() {
    assert!(is_slower(&[1.2, 1.15, 1.3, 1.05, 1.2, 1.25, 1.18], 1.1));
    assert!(!is_slower(&[1.2, 1.0, 1.3, 1.05, 1.2, 0.9, 1.18], 1.1));
    assert!(!is_slower(&[1.0; 7], 1.1));
    assert!(!is_slower(&[], 1.1));
}

#[test]
fn fastest_within_error_skips_faster_ones_with_larger_errors() {
    let measured = [(-60.0, 3.0), (-30.0, 1.0), (-45.0, 2.0), (-45.0, 2.5)];
    assert_eq!(fastest_within(-20.0, &measured), Some(1));
    assert_eq!(fastest_within(-45.0, &measured), Some(2));
    assert_eq!(fastest_within(-50.0, &measured), Some(0));
    assert_eq!(fastest_within(-70.0, &measured), None);
}
