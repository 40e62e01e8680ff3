//! The response of a point: where it lies, how wide it is, how high its side lobes are.
//!
//! A chip around the brightest pixel near a position is interpolated by zero padding its spectrum, once
//! the spectrum has been turned to lie about zero (`chip.rs`). The peak is found to a fraction
//! of a pixel, and cuts run through it along the grid's axes, and on a Cartesian grid along and
//! across a line of sight if one is given. Of each cut:
//!
//! ```text
//! width   between the points of half the peak's power
//! PSLR    10 log10 (highest local maximum outside the main lobe / peak), of power
//! ISLR    10 log10 (energy outside the main lobe, within the cut / energy inside it)
//! ```
//!
//! by two rules of what the main lobe is: between the first minima, or within a given number of
//! 3 dB widths ([`Settings::main_lobe_widths`]). The first suits clean responses, the second noisy ones,
//! whose first minimum can be anywhere. The ISLR of two dimensions is that of the rectangle of both cuts' spans against
//! the rectangle between the first minima.
//!
//! All of that is in units of the response and not of pixels: a chip reaches [`REACH_WIDTHS`] widths where there is room, of every
//! second or third pixel and so on where pixels are many a width (an image holds no more than its band), and
//! side lobes count within [`SPAN_WIDTHS`].
//!
//! An image whose pixels are too coarse for the spatial frequencies at the point is refused if [`Settings::looks`] tells them
//! ([`ResponseError::TooCoarse`]): it has folded, and what it shows is not the response.
//!
//! Neglected: a chip is a piece of the response, and zero padding takes it for periodic. What it
//! does not hold differs between its edges by the side lobes there, for an unweighted band and 12 widths
//! -32 dB of amplitude; near the peak that comes to less than a hundredth of it. Half the resolution cell is a good
//! step.
//!
//! The phase is that at the peak. Between pixels it depends on how often the phase turns a pixel, which
//! the pixels tell up to whole turns only. [`Settings::carrier`] tells the rest ([`Carrier`]); without it
//! the slowest turn is taken, and the phase is good for images that were brought down to zero frequency only:
//! [`Response::turn_is_known`] says which. A carrier does not make the phase better than the position: a
//! thousandth of 3 cm off in range is 0.7 degrees.
//!
//! Accuracy (`tests/images/quality.rs`): position to 1/128 of the resolution, width to 1 %, PSLR and ISLR to
//! 0.2 dB of theory, for unweighted, Hamming and Taylor bands. Memory: the chip at
//! [`UPSAMPLING`] times its rate, at most 27 MB.

mod carrier;
mod checks;
mod chip;
mod cut;
mod error;
mod measurement;
mod search;
mod size;
mod strongest;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_resolution::support::Looks;

pub use carrier::{Carrier, Geometry};
pub use cut::{Cut, Direction, SPAN_WIDTHS};
pub use error::ResponseError;
pub use measurement::{measure, measure_in};
pub use search::brightest_in;
pub use strongest::{Strongest, strongest};
pub use subaperture_resolution::theory::SideLobes;

/// Samples of a chip's picture and of its cuts a pixel.
pub const UPSAMPLING: usize = 16;

/// How far the brightest pixel must stand above the median power of its chip to be a point, dB. Of 81 x
/// 81 pixels of nothing but noise the brightest stands 11 dB above the median, and above 13.5 dB less
/// than once in a thousand chips.
pub const LEAST_PEAK_DB: f64 = 14.0;

/// 3 dB widths that a chip reaches from its middle, where there is room.
pub const REACH_WIDTHS: f64 = 12.0;

/// Most of the cycles that pixels can hold, one a step, that the support may take: chips are pieces, and need some
/// room to be interpolated.
pub const MOST_FILLED: f64 = 0.85;

/// Which point to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// The brightest pixel of the image.
    Brightest,
    /// The brightest pixel within [`Settings::search_px`] rows and columns of grid coordinates.
    Near {
        /// x, or angle in radians.
        column_value: f64,
        /// y, or range.
        row_value: f64,
    },
}

/// How to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<'a> {
    /// Rows and columns around a position that are searched for the brightest pixel.
    pub search_px: usize,
    /// How far a chip reaches from its middle, rows and columns, where there is room; `None` for
    /// [`REACH_WIDTHS`], 8 to 40 pixels, or every so manieth where that many widths have more.
    pub half_chip: Option<[usize; 2]>,
    /// Half of the fixed rule's main lobe, 3 dB widths.
    pub main_lobe_widths: f64,
    /// Angle of the line of sight in the grid's plane, from x towards y, radians.
    pub line_of_sight_rad: Option<f64>,
    /// Where the image was seen from, which tells how often its phase turns a pixel.
    pub carrier: Option<Carrier>,
    /// What the image was formed from, which tells how fine its pixels must be.
    pub looks: Option<&'a Looks>,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self {
            search_px: 4,
            half_chip: None,
            main_lobe_widths: 1.5,
            line_of_sight_rad: None,
            carrier: None,
            looks: None,
        }
    }
}

/// A point's response.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Response {
    /// Row of the peak, a fraction included.
    pub row: f64,
    /// Column of the peak.
    pub column: f64,
    /// y, or range, of the peak.
    pub row_value: f64,
    /// x, or angle in radians, of the peak.
    pub column_value: f64,
    /// The peak in the scene frame, metres.
    pub position_m: [f64; 3],
    /// Magnitude of the peak, dB; 0 is a unit scatterer.
    pub level_db: f64,
    /// Phase of the peak, radians in (-pi, pi].
    pub phase_rad: f64,
    /// Turn of the phase a row and a column, radians, by which the phase was carried to the peak.
    pub turn: [f64; 2],
    /// Whether that is the true turn, or else the slowest that the pixels allow.
    pub turn_is_known: bool,
    /// The line of sight that was given, from the grid's x towards its y, radians.
    pub line_of_sight_rad: Option<f64>,
    /// The cuts: along x, along y, then along and across the line of sight if it was given.
    pub cuts: Vec<Cut>,
    /// ISLR of two dimensions; `None` if a first minimum is not within the chip.
    pub islr_2d_db: Option<f64>,
    /// The chip, upsampled.
    #[serde(skip)]
    pub chip: UpsampledChip,
}

/// A chip at [`UPSAMPLING`] times its rate.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct UpsampledChip {
    /// Values, with the mean turn of the phase taken out.
    pub image: Image,
    /// Where they lie.
    pub grid: ImageGrid,
}
