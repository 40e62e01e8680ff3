//! Medians and angles.

use glam::DVec3;

pub(super) fn positive(value: f64) -> Option<f64> {
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Median of the values; `None` unless positive.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().and_then(positive)
}

/// Angle between two vectors, radians; 0 for a zero vector.
pub(super) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    // More accurate than the arc cosine for small angles.
    libm::atan2(a.cross(b).length(), a.dot(b))
}
