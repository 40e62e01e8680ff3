//! Percent difference of two images per pixel.
//!
//! Schone 2020, figure 4.10 and its text: the difference of the images in percent. The thesis shows
//! 0 to 200 % and notes that the largest values occur where the image is darkest, because a small difference
//! from a small value is a large percentage. Of magnitudes:
//!
//! ```text
//! d = 100 | |a| - |b| | / |b|
//! ```
//!
//! Pixels where `b` is more than a given number of decibels below its peak are NaN, which
//! excludes noise; so are non-finite pixels.

use super::{PairError, PixelMap, check_sizes};
use subaperture_model::image::{Image, power};

/// Percent difference map and its summary.
#[derive(Clone, Debug, PartialEq)]
pub struct PercentDifference {
    /// Difference per pixel, percent; NaN for excluded pixels.
    pub map: PixelMap,
    /// Statistics of the map.
    pub summary: PercentSummary,
}

/// Statistics of the percent difference; `None` if all pixels are excluded.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PercentSummary {
    /// Number of pixels compared.
    pub num_pixels: usize,
    /// Number of pixels excluded: below the floor, or not finite.
    pub num_excluded: usize,
    /// Mean difference, percent.
    pub mean: Option<f64>,
    /// Median difference, percent.
    pub median: Option<f64>,
    /// 95th percentile, percent.
    pub percentile_95: Option<f64>,
    /// Largest difference, percent.
    pub largest: Option<f64>,
}

/// Percent difference of `a` from `b`, for pixels of `b` within `floor_db` (positive, dB) of its peak.
///
/// # Errors
/// [`PairError`] if the sizes differ.
pub fn percent_difference(
    a: &Image,
    b: &Image,
    floor_db: f64,
) -> Result<PercentDifference, PairError> {
    check_sizes(a, b)?;
    let finite = b.pixels.iter().map(|&z| power(z)).filter(|p| p.is_finite());
    let floor = finite.fold(0.0, f64::max) * 10f64.powf(-floor_db / 10.0);
    let percent = |(&u, &v): (_, _)| {
        let (u, v) = (power(u), power(v));
        match v > 0.0 && v >= floor && u.is_finite() && v.is_finite() {
            true => 100.0 * (u.sqrt() - v.sqrt()).abs() / v.sqrt(),
            false => f64::NAN,
        }
    };
    let all: Vec<f64> = a.pixels.iter().zip(&b.pixels).map(percent).collect();
    let mut values: Vec<f64> = all.iter().copied().filter(|v| !v.is_nan()).collect();
    values.sort_unstable_by(f64::total_cmp);
    let num_pixels = values.len();
    let rank = |part: f64| {
        let last = num_pixels.checked_sub(1)?;
        Some(values[(part * last as f64).round() as usize])
    };
    let summary = PercentSummary {
        num_pixels,
        num_excluded: all.len() - num_pixels,
        mean: (num_pixels > 0).then(|| values.iter().sum::<f64>() / num_pixels as f64),
        median: rank(0.5),
        percentile_95: rank(0.95),
        largest: rank(1.0),
    };
    Ok(PercentDifference {
        map: PixelMap {
            rows: a.rows,
            columns: a.columns,
            values: all.into_iter().map(|v| v as f32).collect(),
        },
        summary,
    })
}
