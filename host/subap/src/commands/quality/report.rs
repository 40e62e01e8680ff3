//! Measurements of an image by `subap quality`.

use std::fmt;

use serde::Serialize;
use subaperture::image::Comparison;
use subaperture::quality::PixelMap;
use subaperture::quality::difference::{PercentDifference, PercentSummary};
use subaperture::quality::registration::Offset;
use subaperture::quality::response::Response;
use subaperture::quality::statistics::Statistics;

use super::theory::Theory;

/// All measurements of an image.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) image: String,
    pub(super) window: Option<String>,
    pub(super) points: Vec<Point>,
    pub(super) statistics: Statistics,
    pub(super) against: Option<Against>,
}

/// Point response with the theory for each of its cuts.
#[derive(Serialize)]
pub(super) struct Point {
    pub(super) response: Response,
    /// Chip formed for this point, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) formed: Option<FormedChip>,
    /// Theory for pulses of equal strength.
    pub(super) theory: Vec<Option<Theory>>,
    /// Theory for pulses weighted by the illumination measured from the recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) theory_with_gain: Vec<Option<Theory>>,
}

/// Difference from another image.
#[derive(Serialize)]
pub(super) struct Against {
    pub(super) image: String,
    /// Compared values: `complex` or `amplitudes`.
    pub(super) values: &'static str,
    /// Numbers of compared rows and columns.
    pub(super) pixels: [usize; 2],
    /// Processing steps and assumptions of the comparison.
    pub(super) notes: Vec<String>,
    pub(super) comparison: Comparison,
    pub(super) percent_difference: PercentSummary,
    pub(super) mean_coherence: Option<f64>,
    /// Offset between the images; `None` if one has no contrast.
    pub(super) offset_pixels: Option<Offset>,
    #[serde(skip)]
    pub(super) difference: PercentDifference,
    #[serde(skip)]
    pub(super) coherence: PixelMap,
}

/// Description of how a chip was formed.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FormedChip {
    pub(super) former: &'static str,
    /// Number of pixels along a side.
    pub(super) pixels: usize,
    /// Pixel steps along rows and columns, metres; radians for the angle of a polar grid.
    pub(super) steps: [f64; 2],
}

impl fmt::Display for FormedChip {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [row, column] = self.steps;
        write!(
            to,
            "measured on {0} x {0} pixels formed from the recording by {1}, steps {column:.3e} and {row:.3e}",
            self.pixels, self.former
        )
    }
}
