//! The percent difference of two images, pixel by pixel.
//!
//! Schone 2020, figure 4.10 and the text before it: the difference of the images, in percent. He shows
//! 0 to 200 % and notes that the largest values lie where the image is darkest, for a small difference
//! from a small value is a large percentage. Of magnitudes:
//!
//! ```text
//! d = 100 | |a| - |b| | / |b|
//! ```
//!
//! Pixels where `b` lies further than a given number of decibels below its peak have no value (NaN), so
//! that noise on darkness does not count; so have those that are not finite.

use super::{PairError, PixelMap, check_sizes};
use subaperture_model::image::{Image, power};

/// Percent differences.
#[derive(Clone, Debug, PartialEq)]
pub struct PercentDifference {
    /// The value of each pixel, percent; NaN where there is none.
    pub map: PixelMap,
    /// What it comes to.
    pub summary: PercentSummary,
}

/// What the percent differences of two images come to. `None` if no pixel has one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PercentSummary {
    /// Pixels with a value.
    pub num_pixels: usize,
    /// Pixels without: too dark, or not finite.
    pub num_excluded: usize,
    /// Mean, percent.
    pub mean: Option<f64>,
    /// Median, percent.
    pub median: Option<f64>,
    /// The value that 95 of 100 pixels do not exceed, percent.
    pub percentile_95: Option<f64>,
    /// Largest, percent.
    pub largest: Option<f64>,
}

/// The percent difference of `a` from `b`, where `b` is within `floor_db` (positive) of its peak.
///
/// # Errors
/// [`PairError`].
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
