//! Relative RMS error in decibels.

use num_complex::Complex64;

/// Relative RMS error in dB: negative infinity if both are equal, infinity if only one is zero or their lengths differ.
pub(super) fn error_db(got: &[Complex64], expected: &[Complex64]) -> f64 {
    if got.len() != expected.len() {
        return f64::INFINITY;
    }
    let pairs = got.iter().zip(expected);
    let error = pairs.map(|(a, b)| (a - b).norm_sqr()).sum();
    ratio_db(error, expected.iter().map(Complex64::norm_sqr).sum())
}

/// `error / power` in dB; infinite if NaN.
pub(super) fn ratio_db(error: f64, power: f64) -> f64 {
    match error == 0.0 {
        true => f64::NEG_INFINITY,
        false => Some(10.0 * (error / power).log10())
            .filter(|db| !db.is_nan())
            .unwrap_or(f64::INFINITY),
    }
}
