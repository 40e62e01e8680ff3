//! Measures of point images: levels, widths, positions.

use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};

/// Level of the brightest pixel, dB.
pub(super) fn peak_db(image: &Image) -> f64 {
    let peak = image.peak().map_or(0.0, |peak| power(peak.value));
    10.0 * peak.log10()
}

/// 3 dB widths through the peak along columns and rows, metres, by linear interpolation.
pub(super) fn widths_m(image: &Image, grid: &ImageGrid) -> (f64, f64) {
    let Some(peak) = image.peak() else {
        return (f64::NAN, f64::NAN);
    };
    let row: Vec<f64> = (0..image.columns)
        .map(|column| power(image.pixels[peak.row * image.columns + column]))
        .collect();
    let column: Vec<f64> = (0..image.rows)
        .map(|row| power(image.pixels[row * image.columns + peak.column]))
        .collect();
    (
        width(&row, peak.column) * grid.columns.step,
        width(&column, peak.row) * grid.rows.step,
    )
}

/// 3 dB width about a peak, elements.
fn width(powers: &[f64], peak: usize) -> f64 {
    let half = 0.5 * powers[peak];
    let reach = |mut side: Box<dyn Iterator<Item = f64>>| {
        let mut before = powers[peak];
        let mut steps = 0.0;
        side.find_map(|power| {
            steps += 1.0;
            let crossed = (power < half).then(|| steps - 1.0 + (before - half) / (before - power));
            before = power;
            crossed
        })
        .unwrap_or(f64::NAN)
    };
    let (left, right) = (powers[..peak].to_vec(), powers[peak + 1..].to_vec());
    reach(Box::new(left.into_iter().rev())) + reach(Box::new(right.into_iter()))
}

/// Larger level of both sides at a distance in x in the peak's row, relative to the peak, dB.
pub(super) fn level_db(image: &Image, grid: &ImageGrid, distance_m: f64) -> f64 {
    strongest_near(image, grid, distance_m).1
}

/// Position and level of the strongest pixel within half a metre of a distance on either side, in the
/// peak's row.
pub(super) fn strongest_near(image: &Image, grid: &ImageGrid, distance_m: f64) -> (f64, f64) {
    let Some(peak) = image.peak() else {
        return (f64::NAN, f64::NAN);
    };
    let centre = grid.columns.at(peak.column);
    let line = &image.pixels[peak.row * image.columns..(peak.row + 1) * image.columns];
    line.iter()
        .enumerate()
        .map(|(column, &z)| ((grid.columns.at(column) - centre).abs(), power(z)))
        .filter(|(place, _)| (place - distance_m).abs() <= 0.5)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or((f64::NAN, f64::NAN), |(place, level)| {
            (place, 10.0 * (level / power(peak.value)).log10())
        })
}

/// Largest magnitude difference of two images, each normalised to its peak, dB.
pub(super) fn largest_difference_db(a: &Image, b: &Image) -> f64 {
    let peak = |image: &Image| image.peak().map_or(f64::NAN, |p| power(p.value).sqrt());
    let (a_peak, b_peak) = (peak(a), peak(b));
    let largest = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(&u, &v)| (power(u).sqrt() / a_peak - power(v).sqrt() / b_peak).abs())
        .fold(0.0, f64::max);
    20.0 * largest.log10()
}

/// Positions and relative levels of an image of one row or column, dB.
pub(super) fn points_db(image: &Image, axis: &Axis) -> Vec<(f64, f64)> {
    let peak = image.peak().map_or(f64::NAN, |peak| power(peak.value));
    let levels = image
        .pixels
        .iter()
        .map(|&z| 10.0 * (power(z) / peak).log10());
    levels
        .enumerate()
        .map(|(i, level)| (axis.at(i), level))
        .collect()
}
