//! Figures of merit of an image, maximised by a search.

use std::fmt;
use std::str::FromStr;

use num_complex::Complex32;

use crate::trials::Views;
use subaperture_focus::bp::Backprojection;
use subaperture_focus::{FormError, ImageFormer, Remedy, Task};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, PulseRange, Weights};
use subaperture_quality::statistics::{Region, Statistics};
use subaperture_signal::window::Window;

use glam::DVec3;

/// Sharpness measure of an image; see [`subaperture_quality::statistics`] for the formulas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Negated entropy of power. All of the image contributes: suited to scenes with many points.
    #[default]
    Entropy,
    /// Sum of squared power. The brightest points dominate: suited to scenes with few points.
    Sharpness,
    /// Contrast of amplitude: between entropy and sharpness in its weight of bright points.
    Contrast,
    /// Power of the brightest pixel.
    Peak,
}

/// Grid or points for the merit.
#[derive(Clone, Debug, PartialEq)]
pub enum Sight {
    /// Sharpness of the image on a grid.
    Grid(ImageGrid, Measure),
    /// Sum of the image's power at points of known position (calibration reflectors). It determines shifts within the
    /// resolution in range and cross-range, which focus alone hardly does.
    Points(Vec<DVec3>),
}

/// Error bound of backprojection, dB: too small to move a maximum.
const ERROR_DB: f64 = -40.0;

/// Monitor that forwards cancellation and suppresses progress.
pub(super) struct Quiet<'a>(pub(super) &'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn progress(&self, _fraction: f64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Merit of the image of a history, formed by backprojection with the windows `fast` and `slow`; negative infinity for
/// a dark image. Powers depend on the image's scale, the other figures do not.
///
/// # Errors
/// [`FormError`].
pub fn merit(
    history: &dyn PhaseHistory,
    sight: &Sight,
    [fast, slow]: [Window; 2],
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<f64, FormError> {
    let weights = Weights::new(history.collection(), fast, slow);
    let quiet = Quiet(monitor);
    let form = |grid: &ImageGrid| {
        let task = Task {
            history,
            grid,
            weights: &weights,
            memory_bytes,
            monitor: &quiet,
            numerics: Default::default(),
        };
        let former = Backprojection { error_db: ERROR_DB };
        // A search also forms dark images.
        former.form_planned(&task).map(|formed| formed.image)
    };
    let mut pixels = Vec::new();
    match sight {
        Sight::Grid(grid, _) => pixels = form(grid)?.pixels,
        Sight::Points(points) => {
            for point in points {
                pixels.extend(form(&pixel(*point))?.pixels);
            }
        }
    }
    Ok(figure(sight, pixels))
}

/// Number of contiguous parts of the aperture; [`merits`] omits one at a time.
pub const PARTS: usize = 8;

/// Merit of the image of a history as by [`merit`], followed by the merits of the images without each of [`PARTS`] parts of the
/// aperture. An image is a sum over pulses, so that all together cost as much as one. With fewer pulses than twice the parts, only
/// the first merit is returned.
///
/// # Errors
/// [`FormError`].
pub fn merits(
    history: &dyn PhaseHistory,
    sight: &Sight,
    windows: [Window; 2],
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<Views, FormError> {
    let collection = history.collection();
    let count = collection.pulses.len();
    if count < 2 * PARTS {
        return merit(history, sight, windows, memory_bytes, monitor).map(Views::from);
    }
    let weights = Weights::new(collection, windows[0], windows[1]);
    let total_weight: f64 = weights.slow.iter().sum();
    let grids: Vec<ImageGrid> = match sight {
        Sight::Grid(grid, _) => vec![grid.clone()],
        Sight::Points(points) => points.iter().map(|point| pixel(*point)).collect(),
    };
    let num_pixels: u64 = grids.iter().map(ImageGrid::num_pixels).sum();
    let held = num_pixels.saturating_mul(8 * (PARTS as u64 + 2));
    let left = memory_bytes.checked_sub(held).ok_or(FormError::Memory {
        purpose: "tuning",
        needed_bytes: held.into(),
        budget_bytes: memory_bytes,
        remedies: &[Remedy::MoreMemory, Remedy::FewerPixels],
    })?;
    let quiet = Quiet(monitor);
    let mut whole = vec![Complex32::ZERO; num_pixels as usize];
    let mut parts: Vec<(Vec<Complex32>, f64)> = Vec::with_capacity(PARTS);
    for part in 0..PARTS {
        let range = part * count / PARTS..(part + 1) * count / PARTS;
        let stretch = PulseRange::new(history, range.clone());
        let weights = Weights {
            fast: weights.fast.clone(),
            slow: weights.slow[range].to_vec(),
            illumination: None,
            windows: None,
        };
        let weight = weights.slow.iter().sum::<f64>() / total_weight;
        let mut pixels = Vec::with_capacity(num_pixels as usize);
        for grid in &grids {
            let task = Task {
                history: &stretch,
                grid,
                weights: &weights,
                memory_bytes: left,
                monitor: &quiet,
                numerics: Default::default(),
            };
            let former = Backprojection { error_db: ERROR_DB };
            pixels.extend(former.form_planned(&task)?.image.pixels);
        }
        // Each image is normalised by its own weights, their sum by the sum of weights.
        for (sum, pixel) in whole.iter_mut().zip(&mut pixels) {
            *pixel *= weight as f32;
            *sum += *pixel;
        }
        parts.push((pixels, weight));
    }
    let mut views = vec![figure(sight, whole.clone())];
    for (pixels, weight) in parts {
        let scale = 1.0 / (1.0 - weight as f32);
        let rest = whole
            .iter()
            .zip(&pixels)
            .map(|(all, part)| (all - part) * scale);
        views.push(figure(sight, rest.collect()));
    }
    Ok(Views(views))
}

/// Grid of a single pixel.
fn pixel(point: DVec3) -> ImageGrid {
    let at = |start| Axis {
        start,
        step: 1.0,
        count: 1,
    };
    ImageGrid::horizontal(at(point.x), at(point.y), point.z)
}

/// Figure of merit of an image's pixels.
fn figure(sight: &Sight, pixels: Vec<Complex32>) -> f64 {
    let figure = match sight {
        Sight::Grid(grid, measure) => {
            let image = Image {
                rows: grid.rows.count,
                columns: grid.columns.count,
                pixels,
            };
            let figures = Statistics::of(&image, &Region::whole(&image));
            match measure {
                Measure::Entropy => figures.entropy.map(|entropy| -entropy),
                Measure::Sharpness => figures.sharpness,
                Measure::Contrast => figures.amplitude_contrast,
                Measure::Peak => image.peak().map(|peak| power(peak.value)),
            }
        }
        Sight::Points(_) => {
            let sum: f64 = pixels.iter().map(|&pixel| power(pixel)).sum();
            (sum > 0.0).then_some(sum)
        }
    };
    figure.unwrap_or(f64::NEG_INFINITY)
}

/// Unknown name of a measure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown measure '{0}': expected entropy, sharpness, contrast or peak")]
pub struct UnknownMeasure(String);

impl FromStr for Measure {
    type Err = UnknownMeasure;

    fn from_str(text: &str) -> Result<Self, UnknownMeasure> {
        match text {
            "entropy" => Ok(Self::Entropy),
            "sharpness" => Ok(Self::Sharpness),
            "contrast" => Ok(Self::Contrast),
            "peak" => Ok(Self::Peak),
            _ => Err(UnknownMeasure(text.to_owned())),
        }
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Entropy => "entropy",
            Self::Sharpness => "sharpness",
            Self::Contrast => "contrast",
            Self::Peak => "peak",
        })
    }
}
