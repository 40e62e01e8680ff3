//! Figures of merit of an image: what a search makes as large as it can.

use std::fmt;
use std::str::FromStr;

use crate::focus::bp::Backprojection;
use crate::focus::{FormError, ImageFormer, Monitor, Task, Weights};
use crate::geometry::{Axis, ImageGrid};
use crate::image::power;
use crate::phase_history::PhaseHistory;
use crate::quality::statistics::{Region, Statistics};
use crate::signal::window::Window;

use glam::DVec3;

/// What is measured of an image; see [`crate::quality::statistics`] for the formulas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Entropy of power, negated. Counts all that is in the image: of a scene with many points.
    #[default]
    Entropy,
    /// Sum of squared power: counts the brightest points. Of a scene with few.
    Sharpness,
    /// Contrast of amplitude: between both.
    Contrast,
    /// Power of the brightest pixel.
    Peak,
}

/// What is looked at.
#[derive(Clone, Debug, PartialEq)]
pub enum Sight {
    /// The image on a grid, by a measure.
    Grid(ImageGrid, Measure),
    /// Points of known positions, calibration reflectors: the sum of the image's power there. As sharp in
    /// range and cross-range as the image itself, where focus alone hardly tells a shift.
    Points(Vec<DVec3>),
}

/// Error that backprojection may have, dB: far below what moves a maximum.
const ERROR_DB: f64 = -40.0;

/// Tells nothing but when to stop.
struct Quiet<'a>(&'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn progress(&self, _fraction: f64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// The merit of a history's image, formed by backprojection with the windows `fast` and `slow`; negative infinity of
/// a dark one. Powers depend on the image's scale, the other figures do not.
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
        };
        let former = Backprojection { error_db: ERROR_DB };
        // A search looks at dark places too.
        former.form_best(&task).map(|formed| formed.image)
    };
    match sight {
        Sight::Grid(grid, measure) => {
            let image = form(grid)?;
            let figures = Statistics::of(&image, &Region::whole(&image));
            let figure = match measure {
                Measure::Entropy => figures.entropy.map(|entropy| -entropy),
                Measure::Sharpness => figures.sharpness,
                Measure::Contrast => figures.amplitude_contrast,
                Measure::Peak => image.peak().map(|peak| power(peak.value)),
            };
            Ok(figure.unwrap_or(f64::NEG_INFINITY))
        }
        Sight::Points(points) => {
            let mut sum = 0.0;
            for point in points {
                let at = |start| Axis {
                    start,
                    step: 1.0,
                    count: 1,
                };
                let grid = ImageGrid::horizontal(at(point.x), at(point.y), point.z);
                sum += power(form(&grid)?.pixels[0]);
            }
            Ok(if sum > 0.0 { sum } else { f64::NEG_INFINITY })
        }
    }
}

/// A measure's name is not one of the known ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("measure '{0}': write entropy, sharpness, contrast or peak")]
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
