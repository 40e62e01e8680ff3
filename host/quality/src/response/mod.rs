//! Impulse response (point target) measurement: position, 3 dB width, PSLR and ISLR.
//!
//! A chip around the brightest pixel near a position is shifted to zero frequency and interpolated by zero padding (`chip.rs`). The peak is found to a fraction
//! of a pixel. Cuts run through it along the grid's axes and, on a Cartesian grid, along and
//! across the line of sight if one is given. For each cut:
//!
//! ```text
//! width   between the points of half the peak's power
//! PSLR    10 log10 (highest local maximum outside the main lobe / peak), of power
//! ISLR    10 log10 (energy outside the main lobe, within the cut / energy inside it)
//! ```
//!
//! with two definitions of the main lobe: between the first minima, or within a given number of
//! 3 dB widths ([`Settings::main_lobe_widths`]). The first suits clean responses, the second noisy ones,
//! whose first minimum is random. The two-dimensional ISLR compares the rectangle of both cuts' spans with
//! the rectangle between the first minima.
//!
//! Extents are in 3 dB widths, not pixels: a chip extends [`REACH_WIDTHS`] widths where the image allows. An oversampled image
//! is decimated to every n-th pixel. Sidelobes are evaluated within [`SPAN_WIDTHS`].
//!
//! If [`Settings::looks`] is given, an image that undersamples the spectral support at the point is refused
//! ([`ResponseError::TooCoarse`]), because its response is aliased.
//!
//! Neglected: the chip truncates the response, and zero padding assumes it periodic. The sidelobes at the
//! edge, -32 dB of amplitude for an unweighted band and 12 widths, cause an error below a hundredth of that
//! near the peak. Half the resolution cell is a good pixel spacing.
//!
//! The phase is that at the peak. Between pixels it depends on the phase gradient, which
//! the pixels determine modulo one turn per pixel. [`Settings::carrier`] resolves the ambiguity ([`Carrier`]). Without it
//! the smallest gradient is assumed, which is right only for images at baseband;
//! [`Response::turn_is_known`] reports it. The phase is no more accurate than the position: a range error of
//! a thousandth of 3 cm is 0.7 degrees.
//!
//! **Accuracy** (`tests/images/quality.rs`): position 1/128 of the resolution, width 1 %, PSLR and ISLR
//! 0.2 dB of theory, for uniform, Hamming and Taylor weighting. **Memory** the chip at
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

use num_complex::{Complex32, Complex64};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};
use subaperture_model::resolution::support::Looks;

use self::chip::Chip;

pub use carrier::{Carrier, Geometry};
pub use cut::{Cut, Direction, SPAN_WIDTHS};
pub use error::ResponseError;
pub use measurement::{measure, measure_in};
pub use search::brightest_in;
pub use strongest::{Strongest, strongest};
pub use subaperture_model::resolution::theory::SideLobes;

/// Upsampling factor of a chip and its cuts, samples per pixel.
pub const UPSAMPLING: usize = 16;

/// Smallest level of a peak above the median power of its chip, dB. In 81 x
/// 81 pixels of noise the brightest is 11 dB above the median on average, and above 13.5 dB in less
/// than one of a thousand chips.
pub const MIN_PEAK_DB: f64 = 14.0;

/// Half-size of a chip, 3 dB widths, where the image allows.
pub const REACH_WIDTHS: f64 = 12.0;

/// Largest support, cycles per pixel; interpolation of a truncated chip needs some
/// oversampling.
pub const MAX_FILLED: f64 = 0.85;

/// Point to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Brightest pixel of the image.
    Brightest,
    /// Brightest pixel within [`Settings::search_px`] rows and columns of grid coordinates.
    Near {
        /// x in metres, or angle in radians.
        column_value: f64,
        /// y or range, metres.
        row_value: f64,
    },
}

/// Settings of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<'a> {
    /// Search half-width around a position, pixels.
    pub search_px: usize,
    /// Half-size of the chip, rows and columns. Default (`None`):
    /// [`REACH_WIDTHS`] widths, 8 to 40 pixels, of every n-th pixel where the image is finer.
    pub half_chip: Option<[usize; 2]>,
    /// Half-width of the fixed main lobe, 3 dB widths.
    pub main_lobe_widths: f64,
    /// Line of sight in the grid's plane, radians from x towards y. `None`: no cuts along and across it.
    pub line_of_sight_rad: Option<f64>,
    /// Acquisition geometry, which resolves the phase gradient. `None`: the smallest gradient is assumed.
    pub carrier: Option<Carrier>,
    /// Support of the image, for the check of the pixel spacing. `None`: no check.
    pub looks: Option<&'a Looks>,
    /// Most memory for the pixels around a point of an image that is read part by part, bytes; default: no limit, 270 MB are the most.
    pub memory_bytes: u64,
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
            memory_bytes: u64::MAX,
        }
    }
}

/// Measured impulse response.
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
    /// Phase gradient, radians per row and per column, with which the phase was extrapolated to the peak.
    pub turn: [f64; 2],
    /// Whether that is the true turn, or else the slowest that the pixels allow.
    pub turn_is_known: bool,
    /// The line of sight that was given, from the grid's x towards its y, radians.
    pub line_of_sight_rad: Option<f64>,
    /// Cuts along x and y, then along and across the line of sight if given.
    pub cuts: Vec<Cut>,
    /// Two-dimensional ISLR, dB; `None` if a first minimum is outside the chip.
    pub islr_2d_db: Option<f64>,
    /// Upsampled chip.
    #[serde(skip)]
    pub chip: UpsampledChip,
}

/// Chip at [`UPSAMPLING`] times its rate.
///
/// Values are without the mean phase step. They are computed row by row on access: all values of a chip of 81 x 81 pixels
/// would take 13 MB.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct UpsampledChip {
    chip: Chip,
    /// Grid of the values.
    pub grid: ImageGrid,
}

impl UpsampledChip {
    /// Chip whose first pixel is `first` of the grid, with a spacing of `steps` pixels.
    fn new(chip: Chip, grid: &ImageGrid, first: [usize; 2], steps: [f64; 2]) -> Self {
        let finer = |axis: &Axis, i: usize, count: usize| Axis {
            start: axis.at(first[i]),
            step: steps[i] / UPSAMPLING as f64,
            count: count * UPSAMPLING,
        };
        Self {
            grid: ImageGrid {
                rows: finer(&grid.rows, 0, chip.rows),
                columns: finer(&grid.columns, 1, chip.columns),
                ..grid.clone()
            },
            chip,
        }
    }
}

impl ImageSource for UpsampledChip {
    fn size(&self) -> (usize, usize) {
        (self.grid.rows.count, self.grid.columns.count)
    }

    fn places(&self) -> PixelBlocks {
        bands(self.grid.rows.count, self.grid.columns.count)
    }

    fn window(&self, [rows, columns]: &PixelBlock) -> Result<Image, ImageSourceError> {
        let mut pixels = Vec::with_capacity(rows.len() * columns.len());
        self.chip.fine_rows(UPSAMPLING, rows.clone(), |_, row| {
            let narrow = |z: &Complex64| Complex32::new(z.re as f32, z.im as f32);
            pixels.extend(row[columns.clone()].iter().map(narrow));
        });
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels,
        })
    }
}
