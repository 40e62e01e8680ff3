//! Candidates for persistent points, by level and amplitude dispersion.

use num_complex::Complex64;
use subaperture_model::image::{Image, power};

use super::error::DisplacementError;
use super::passes::{Passes, PointChoice, Settings};

/// Smallest number of points.
const LEAST_POINTS: usize = 3;

/// Pixel that is bright and steady in all passes.
pub(super) struct Candidate {
    pub(super) row: usize,
    pub(super) column: usize,
    /// Mean power over the passes.
    pub(super) power: f64,
    /// Amplitude dispersion index, calibrated.
    pub(super) dispersion: f64,
    /// Values in all passes.
    pub(super) values: Vec<Complex64>,
}

/// Candidates, and the number of pixels above the floor.
pub(super) fn select(
    passes: &Passes,
    settings: &Settings,
) -> Result<(Vec<Candidate>, usize), DisplacementError> {
    let powers = mean_powers(passes.images);
    let mut finite: Vec<f32> = powers.iter().copied().filter(|p| p.is_finite()).collect();
    let middle = finite.len() / 2;
    let median = match finite.is_empty() {
        true => 0.0,
        false => f64::from(*finite.select_nth_unstable_by(middle, f32::total_cmp).1),
    };
    drop(finite);
    // A median of zero, as of a noiseless simulation, leaves all pixels with power.
    let floor = median * libm::pow(10.0, settings.floor_db / 10.0);
    let columns = passes.grid.columns.count;
    let bright = |i: &usize| {
        let power = f64::from(powers[*i]);
        power > 0.0 && power >= floor
    };
    let chosen =
        |i: &usize| settings.choice == PointChoice::All || is_maximum(&powers, columns, *i);
    let above: Vec<usize> = (0..powers.len()).filter(bright).collect();
    let bright: Vec<usize> = above.iter().copied().filter(chosen).collect();
    let gains = gains(passes.images, &bright);
    let candidates = bright.iter().filter_map(|&i| {
        let value = |image: &Image| {
            let z = image.pixels[i];
            Complex64::new(z.re.into(), z.im.into())
        };
        let values: Vec<Complex64> = passes.images.iter().map(value).collect();
        let dispersion = dispersion(&values, &gains);
        (dispersion <= settings.dispersion).then_some(Candidate {
            row: i / columns,
            column: i % columns,
            power: f64::from(powers[i]),
            dispersion,
            values,
        })
    });
    // One more shows that there are too many.
    let most = settings.most_points;
    let candidates: Vec<Candidate> = candidates.take(most.saturating_add(1)).collect();
    match candidates.len() {
        found if found < LEAST_POINTS => Err(DisplacementError::TooFewPoints {
            least: LEAST_POINTS,
            found,
            above_floor: above.len(),
            dispersion: settings.dispersion,
            floor_db: settings.floor_db,
        }),
        found if found > most => Err(DisplacementError::TooManyPoints {
            most,
            above_floor: above.len(),
        }),
        _ => Ok((candidates, above.len())),
    }
}

/// Mean power of each pixel over the passes; NaN where a pass has no finite value.
fn mean_powers(images: &[Image]) -> Vec<f32> {
    let share = 1.0 / images.len() as f64;
    let at = |i: usize| {
        images
            .iter()
            .map(|image| power(image.pixels[i]))
            .sum::<f64>()
    };
    let pixels = images.first().map_or(0, |image| image.pixels.len());
    (0..pixels).map(|i| (share * at(i)) as f32).collect()
}

/// Whether a pixel has the highest power of its neighbourhood; the first of equals.
fn is_maximum(powers: &[f32], columns: usize, i: usize) -> bool {
    let (row, column) = (i / columns, i % columns);
    let rows = row.saturating_sub(1)..=(row + 1).min(powers.len() / columns - 1);
    let across = column.saturating_sub(1)..=(column + 1).min(columns - 1);
    rows.flat_map(|row| across.clone().map(move |column| row * columns + column))
        .filter(|&other| other != i)
        .all(|other| match other < i {
            true => powers[other] < powers[i] || powers[other].is_nan(),
            false => powers[other] <= powers[i] || powers[other].is_nan(),
        })
}

/// Gain of each pass: median ratio of the amplitudes to their mean over the passes.
fn gains(images: &[Image], at: &[usize]) -> Vec<f64> {
    let amplitude = |image: &Image, i: usize| power(image.pixels[i]).sqrt();
    let means: Vec<f64> = at
        .iter()
        .map(|&i| images.iter().map(|image| amplitude(image, i)).sum::<f64>() / images.len() as f64)
        .collect();
    let gain = |image: &Image| {
        let mut ratios: Vec<f64> = (at.iter().zip(&means))
            .map(|(&i, mean)| amplitude(image, i) / mean)
            .collect();
        let middle = ratios.len() / 2;
        match ratios.is_empty() {
            true => 1.0,
            false => *ratios.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    };
    images.iter().map(gain).collect()
}

/// Deviation over mean of the calibrated amplitudes.
fn dispersion(values: &[Complex64], gains: &[f64]) -> f64 {
    let amplitudes = || values.iter().zip(gains).map(|(z, gain)| z.norm() / gain);
    let count = values.len() as f64;
    let mean = amplitudes().sum::<f64>() / count;
    let squares: f64 = amplitudes().map(|a| (a - mean) * (a - mean)).sum();
    (squares / (count - 1.0)).sqrt() / mean
}
