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
mod chip;
mod cut;

use std::ops::Range;

use num_complex::{Complex32, Complex64};

use chip::Chip;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, Parts, PartsError, peak_of, power};
use subaperture_resolution::support::Looks;

pub use carrier::{Carrier, Geometry};
pub use cut::{Cut, Direction, SPAN_WIDTHS};
pub use subaperture_resolution::theory::SideLobes;

/// Samples of a chip's picture and of its cuts a pixel.
pub const UPSAMPLING: usize = 16;

/// How far the brightest pixel must stand above the median power of its chip to be a point, dB. Of 81 x
/// 81 pixels of nothing but noise the brightest stands 11 dB above the median, and above 13.5 dB less
/// than once in a thousand chips.
pub const LEAST_PEAK_DB: f64 = 14.0;

/// Least and most that a chip reaches from its middle, pixels.
const LEAST_HALF: usize = 8;
const MOST_HALF: usize = 40;

/// 3 dB widths that a chip reaches from its middle, where there is room.
pub const REACH_WIDTHS: f64 = 12.0;

/// Most of a chip's pixels a 3 dB width: of finer images some are left out.
const MOST_A_WIDTH: f64 = MOST_HALF as f64 / REACH_WIDTHS;

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

/// Why a point was not measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResponseError {
    /// The image and its grid differ, or a position is not on it.
    #[error("{0}")]
    Unsuited(String),
    /// No room for a chip.
    #[error(
        "the peak at row {row}, column {column} is too close to the border: {room} pixels are there \
         and {needed} needed; form the image on a larger grid, or choose another point"
    )]
    Border {
        /// Row of the brightest pixel.
        row: usize,
        /// Its column.
        column: usize,
        /// Pixels to the nearest border.
        room: usize,
        /// Pixels needed.
        needed: usize,
    },
    /// Pixels too far apart for what the pulses sample there.
    #[error(
        "the pixels are too coarse to measure the point at {along} {at:.4}: they are {step:.4} apart along {along}, and {needed:.4} or \
         less is needed where spatial frequencies span {extent:.2} cycles for each of them; form the image on a finer grid"
    )]
    TooCoarse {
        /// The axis: x or y, angle or range.
        along: &'static str,
        /// The peak on it: metres, or radians of an angle.
        at: f64,
        /// Distance from pixel to pixel, in the same unit.
        step: f64,
        /// The most that will do.
        needed: f64,
        /// Extent of the support along the axis.
        extent: f64,
    },
    /// A part of the image could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// Nothing stands out.
    #[error(
        "no point at row {row}, column {column}: the brightest pixel there is {above_db:.1} dB above \
         the median around it, and {LEAST_PEAK_DB} dB are needed to tell a point from noise"
    )]
    NoPeak {
        /// Row of the brightest pixel.
        row: usize,
        /// Its column.
        column: usize,
        /// How far it stands out, dB.
        above_db: f64,
    },
    /// A pixel around the point is NaN or infinite.
    #[error("the image is not finite around row {row}, column {column}")]
    NotFinite {
        /// Row of the point.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl ResponseError {
    /// The same of an image that begins so many rows and columns before.
    fn shifted(self, rows: usize, columns: usize) -> Self {
        match self {
            Self::NoPeak {
                row,
                column,
                above_db,
            } => Self::NoPeak {
                row: row + rows,
                column: column + columns,
                above_db,
            },
            Self::Border {
                row,
                column,
                room,
                needed,
            } => Self::Border {
                row: row + rows,
                column: column + columns,
                room,
                needed,
            },
            Self::NotFinite { row, column } => Self::NotFinite {
                row: row + rows,
                column: column + columns,
            },
            other => other,
        }
    }
}

/// Measures a point of `image`.
///
/// # Errors
/// [`ResponseError`].
pub fn measure(
    image: &Image,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<Response, ResponseError> {
    check_shape(image, grid)?;
    let (row, column) = brightest_in(image, grid, target, settings)?;
    if let Some(looks) = settings.looks {
        check_sampling(looks, grid, (row, column))?;
    }
    let Size { half, stride } = chip_size(image, (row, column), settings.half_chip)?;
    check_peak(image, (row, column), half, stride)?;
    let chip = Chip::cut(image, (row, column), half, stride);
    let (y, x) = chip.peak();

    let peak_row = row as f64 + y * stride[0] as f64;
    let peak_column = column as f64 + x * stride[1] as f64;
    let row_value = grid.rows.start + peak_row * grid.rows.step;
    let column_value = grid.columns.start + peak_column * grid.columns.step;
    let known = settings
        .carrier
        .and_then(|carrier| carrier.turn(grid, row_value, column_value));
    // Turns a pixel of the image; the chip's pixels may be several of these.
    let turn: [f64; 2] = std::array::from_fn(|i| {
        let own = chip.turn[i] / stride[i] as f64;
        let turns = (known.map_or(0.0, |turn| turn[i]) - own) / std::f64::consts::TAU;
        own + turns.round() * std::f64::consts::TAU
    });
    let [row_turn, column_turn] = turn;
    let value = chip.at(y, x)
        * Complex64::cis(
            row_turn * (peak_row - row as f64) + column_turn * (peak_column - column as f64),
        );

    // Of the chip's pixels.
    let steps = [
        grid.rows.step * stride[0] as f64,
        grid.columns.step * stride[1] as f64,
    ];
    let top = value.norm_sqr();
    let line_of_sight_rad = settings.line_of_sight_rad.filter(|_| !grid.polar);
    let cuts: Vec<Cut> = directions(steps, line_of_sight_rad)
        .into_iter()
        .map(|(along, pixels)| {
            let length = cut_length(pixels, [y, x], half);
            cut(&chip, [y, x], (along, pixels), length, top, settings)
        })
        .collect();
    let fine = chip.upsampled(UPSAMPLING);
    let islr_2d_db = integrated_2d_db(&fine, &chip, half, [y, x], &cuts, steps);
    Ok(Response {
        row: peak_row,
        column: peak_column,
        row_value,
        column_value,
        position_m: grid.point_m(row_value, column_value).to_array(),
        level_db: 10.0 * top.log10(),
        phase_rad: value.arg(),
        turn,
        turn_is_known: known.is_some(),
        line_of_sight_rad: settings.line_of_sight_rad,
        cuts,
        islr_2d_db,
        chip: upsampled_chip(
            fine,
            &chip,
            grid,
            [row - half[0] * stride[0], column - half[1] * stride[1]],
            steps,
        ),
    })
}

/// How far around a point an image that is read part by part is taken, pixels: at least, and at most, which is 128 MiB.
const REACH_PX: (usize, usize) = (64, 2048);

/// [`measure`] of an image that need not fit in memory: what lies within [`REACH_WIDTHS`] 3 dB widths of the point, and
/// within 2048 pixels.
///
/// # Errors
/// As [`measure`]; [`ResponseError::Unreadable`].
pub fn measure_in(
    image: &dyn Parts,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<Response, ResponseError> {
    let (row, column) = brightest_in(image, grid, target, settings)?;
    let reach = reach_px(image, (row, column))?;
    let around = |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
    let place = [
        around(row, grid.rows.count),
        around(column, grid.columns.count),
    ];
    let window = image.window(&place).map_err(unreadable)?;
    let [rows, columns] = place;
    let part = |axis: Axis, range: &Range<usize>| Axis {
        start: axis.at(range.start),
        count: range.len(),
        ..axis
    };
    let within = ImageGrid {
        rows: part(grid.rows, &rows),
        columns: part(grid.columns, &columns),
        ..*grid
    };
    let target = Target::Near {
        column_value: grid.columns.at(column),
        row_value: grid.rows.at(row),
    };
    let settings = Settings {
        search_px: 0,
        ..*settings
    };
    let shifted = |error: ResponseError| error.shifted(rows.start, columns.start);
    let mut response = measure(&window, &within, target, &settings).map_err(shifted)?;
    response.row += rows.start as f64;
    response.column += columns.start as f64;
    Ok(response)
}

/// Row and column of the brightest pixel of the target.
///
/// # Errors
/// [`ResponseError::Unsuited`] where there is none; [`ResponseError::Unreadable`].
pub fn brightest_in(
    image: &dyn Parts,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<(usize, usize), ResponseError> {
    if image.size() != (grid.rows.count, grid.columns.count) {
        let (rows, columns) = image.size();
        return Err(ResponseError::Unsuited(format!(
            "the image has {rows} rows x {columns} columns, its grid {} x {}",
            grid.rows.count, grid.columns.count
        )));
    }
    let none = || ResponseError::Unsuited("there is no pixel above zero to measure".to_owned());
    let Target::Near {
        column_value,
        row_value,
    } = target
    else {
        let peak = peak_of(image).map_err(unreadable)?;
        let peak = peak.filter(|p| power(p.value) > 0.0);
        return peak.map(|p| (p.row, p.column)).ok_or_else(none);
    };
    let (row, column) = nearest(grid, row_value, column_value)?;
    let around = |at: usize, count: usize| {
        at.saturating_sub(settings.search_px)..(at + settings.search_px + 1).min(count)
    };
    let place = [
        around(row, grid.rows.count),
        around(column, grid.columns.count),
    ];
    let window = image.window(&place).map_err(unreadable)?;
    // Of equals, the one typed.
    let here = (row - place[0].start) * window.columns + column - place[1].start;
    let mut best = (here, 0.0);
    for (i, &z) in window.pixels.iter().enumerate() {
        if power(z) > best.1 {
            best = (i, power(z));
        }
    }
    let (i, top) = best;
    let at = (
        place[0].start + i / window.columns,
        place[1].start + i % window.columns,
    );
    (top > 0.0).then_some(at).ok_or_else(none)
}

/// How far a chip may reach from a pixel, by the widths of the row and the column through it.
fn reach_px(image: &dyn Parts, (row, column): (usize, usize)) -> Result<usize, ResponseError> {
    let (rows, columns) = image.size();
    let around =
        |at: usize, count: usize| at.saturating_sub(REACH_PX.1)..(at + REACH_PX.1 + 1).min(count);
    let lines = [
        ([row..row + 1, around(column, columns)], column),
        ([around(row, rows), column..column + 1], row),
    ];
    let mut widest = 1;
    for (i, (place, at)) in lines.into_iter().enumerate() {
        let line = image.window(&place).map_err(unreadable)?.pixels;
        let at = at - place[1 - i].start;
        let half = power(line[at]) / 2.0;
        let falls = |z: &Complex32| power(*z) < half;
        let left = line[..at].iter().rev().position(falls).unwrap_or(at);
        let right = line[at + 1..].iter().position(falls);
        let right = right.unwrap_or(line.len() - at - 1);
        widest = widest.max(left + right + 1);
    }
    let reach = ((REACH_WIDTHS + 1.0) * widest as f64).ceil() as usize;
    Ok(reach.clamp(REACH_PX.0, REACH_PX.1))
}

fn unreadable(error: PartsError) -> ResponseError {
    ResponseError::Unreadable(error.to_string())
}

/// The pixel nearest to a place in grid coordinates.
fn nearest(
    grid: &ImageGrid,
    row_value: f64,
    column_value: f64,
) -> Result<(usize, usize), ResponseError> {
    let nearest = |axis: &Axis, value: f64, name: &str| {
        let at = (value - axis.start) / axis.step;
        match (-0.5..=axis.count as f64 - 0.5).contains(&at) {
            true => Ok((at.round().max(0.0) as usize).min(axis.count - 1)),
            false => Err(ResponseError::Unsuited(format!(
                "{name} {value} is not on the image, which reaches from {} to {}",
                axis.start,
                axis.at(axis.count - 1)
            ))),
        }
    };
    let (up, across) = match grid.polar {
        true => ("range", "angle"),
        false => ("y", "x"),
    };
    Ok((
        nearest(&grid.rows, row_value, up)?,
        nearest(&grid.columns, column_value, across)?,
    ))
}

/// Checks that image and grid are of one size.
fn check_shape(image: &Image, grid: &ImageGrid) -> Result<(), ResponseError> {
    let (rows, columns) = (image.rows, image.columns);
    if (rows, columns) != (grid.rows.count, grid.columns.count)
        || rows.checked_mul(columns) != Some(image.pixels.len())
    {
        return Err(ResponseError::Unsuited(format!(
            "the image has {rows} rows x {columns} columns and {} pixels, its grid {} x {}",
            image.pixels.len(),
            grid.rows.count,
            grid.columns.count
        )));
    }
    Ok(())
}

/// Directions of the cuts, each as rows and columns for a unit of length; `steps` are those of the chip.
fn directions(steps: [f64; 2], line_of_sight_rad: Option<f64>) -> Vec<(Direction, [f64; 2])> {
    let mut directions = vec![
        (Direction::X, [0.0, 1.0 / steps[1]]),
        (Direction::Y, [1.0 / steps[0], 0.0]),
    ];
    if let Some(angle) = line_of_sight_rad {
        let (sin, cos) = angle.sin_cos();
        directions.push((Direction::Range, [sin / steps[0], cos / steps[1]]));
        directions.push((Direction::CrossRange, [cos / steps[0], -sin / steps[1]]));
    }
    directions
}

/// The cut through the peak along a direction, of `length` to either side, relative to the power `top` of the peak.
fn cut(
    chip: &Chip,
    [y, x]: [f64; 2],
    (along, pixels): (Direction, [f64; 2]),
    length: f64,
    top: f64,
    settings: &Settings<'_>,
) -> Cut {
    // As fine as the upsampled chip along the axis that advances faster.
    let fastest = pixels[0].abs().max(pixels[1].abs());
    let step = 1.0 / (fastest * UPSAMPLING as f64);
    let count = (length / step).floor() as usize;
    let offsets: Vec<f64> = (0..=2 * count)
        .map(|i| (i as f64 - count as f64) * step)
        .collect();
    let powers = offsets
        .iter()
        .map(|s| chip.power(y + s * pixels[0], x + s * pixels[1]) / top)
        .collect();
    Cut::new(along, offsets, powers, count, settings.main_lobe_widths)
}

/// Whether the grid's pixels hold the support at a pixel.
fn check_sampling(
    looks: &Looks,
    grid: &ImageGrid,
    (row, column): (usize, usize),
) -> Result<(), ResponseError> {
    let support = looks.at(grid.position_m(row, column));
    let [x, y] = grid.directions(grid.rows.at(row), grid.columns.at(column));
    let (across, up) = match grid.polar {
        true => ("angle", "range"),
        false => ("x", "y"),
    };
    for (along, direction, axis, i) in [(across, x, grid.columns, column), (up, y, grid.rows, row)]
    {
        let extent = support
            .extent(direction)
            .map_or(0.0, |[low, high]| high - low);
        if axis.step * extent > MOST_FILLED {
            return Err(ResponseError::TooCoarse {
                along,
                at: axis.at(i),
                step: axis.step,
                needed: MOST_FILLED / extent,
                extent,
            });
        }
    }
    Ok(())
}

/// How far a chip reaches in its own pixels, and how many of the image's each stands for; rows and columns.
struct Size {
    half: [usize; 2],
    stride: [usize; 2],
}

fn chip_size(
    image: &Image,
    (row, column): (usize, usize),
    asked: Option<[usize; 2]>,
) -> Result<Size, ResponseError> {
    let here = power(image.pixels[row * image.columns + column]);
    // Pixels from below half the power on the one side to below it on the other, less the part of a
    // pixel by which both overshoot on average.
    let width = |stride: usize, back: usize, ahead: usize| {
        let at = row * image.columns + column;
        let falls = |i: usize| power(image.pixels[i]) < here / 2.0;
        let left = (1..=back).find(|k| falls(at - k * stride));
        let right = (1..=ahead).find(|k| falls(at + k * stride));
        let (left, right) = (left.unwrap_or(back), right.unwrap_or(ahead));
        ((left + right) as f64 - 1.0).max(1.0)
    };
    let size = |axis: usize, to_next, at: usize, count: usize| {
        let pixels = at.min(count - 1 - at);
        let width_px = width(to_next, at, count - 1 - at);
        let stride = match asked {
            Some(_) => 1,
            None => (width_px / MOST_A_WIDTH).ceil() as usize,
        };
        let (width, room) = (width_px / stride as f64, pixels / stride);
        let wanted = match asked {
            Some(half) => half[axis].clamp(LEAST_HALF, MOST_HALF),
            None => ((REACH_WIDTHS * width).ceil() as usize).clamp(2 * LEAST_HALF, MOST_HALF),
        };
        // With four widths the first side lobes of any window are there.
        let needed = ((4.0 * width).ceil() as usize)
            .clamp(LEAST_HALF, MOST_HALF)
            .min(wanted);
        match room < needed {
            true => Err(ResponseError::Border {
                row,
                column,
                room: pixels,
                needed: needed * stride,
            }),
            false => Ok((wanted.min(room), stride)),
        }
    };
    let (rows, columns) = (
        size(0, image.columns, row, image.rows)?,
        size(1, 1, column, image.columns)?,
    );
    Ok(Size {
        half: [rows.0, columns.0],
        stride: [rows.1, columns.1],
    })
}

/// Whether the brightest pixel is that of a point.
fn check_peak(
    image: &Image,
    (row, column): (usize, usize),
    half: [usize; 2],
    stride: [usize; 2],
) -> Result<(), ResponseError> {
    let reach = |at: usize, i: usize| {
        let most = half[i] * stride[i];
        (at - most..=at + most).step_by(stride[i])
    };
    let mut powers: Vec<f64> = reach(row, 0)
        .flat_map(|i| reach(column, 1).map(move |j| i * image.columns + j))
        .map(|i| power(image.pixels[i]))
        .collect();
    if powers.iter().any(|p| !p.is_finite()) {
        return Err(ResponseError::NotFinite { row, column });
    }
    let middle = powers.len() / 2;
    let (_, median, _) = powers.select_nth_unstable_by(middle, f64::total_cmp);
    let here = power(image.pixels[row * image.columns + column]);
    let above_db = 10.0 * (here / *median).log10();
    match above_db < LEAST_PEAK_DB {
        true => Err(ResponseError::NoPeak {
            row,
            column,
            above_db,
        }),
        false => Ok(()),
    }
}

/// How far a line through the peak stays within the chip to both sides.
fn cut_length(pixels: [f64; 2], peak: [f64; 2], half: [usize; 2]) -> f64 {
    (0..2)
        .filter(|&i| pixels[i].abs() > 1e-12)
        .map(|i| (half[i] as f64 - peak[i].abs()) / pixels[i].abs())
        .fold(f64::INFINITY, f64::min)
}

/// Energy outside the rectangle between the first minima over that inside, within the spans of the cuts.
fn integrated_2d_db(
    fine: &[Complex64],
    chip: &Chip,
    half: [usize; 2],
    peak: [f64; 2],
    cuts: &[Cut],
    steps: [f64; 2],
) -> Option<f64> {
    let (across, down) = (cuts[0].nulls?, cuts[1].nulls?);
    let spans = [cuts[1].span, cuts[0].span];
    let width = chip.columns * UPSAMPLING;
    // Whether a sample lies between the minima; `None` outside the span.
    let inside = |i: usize, axis: usize, nulls: [f64; 2]| {
        let pixels = i as f64 / UPSAMPLING as f64 - half[axis] as f64 - peak[axis];
        let at = pixels * steps[axis];
        let [low, high] = spans[axis];
        (low..=high)
            .contains(&at)
            .then(|| (nulls[0]..=nulls[1]).contains(&at))
    };
    let columns: Vec<Option<bool>> = (0..width).map(|j| inside(j, 1, across)).collect();
    let (mut within, mut beyond) = (0.0, 0.0);
    for (i, row) in fine.chunks_exact(width).enumerate() {
        let Some(row_inside) = inside(i, 0, down) else {
            continue;
        };
        for (z, column_inside) in row.iter().zip(&columns) {
            let Some(column_inside) = *column_inside else {
                continue;
            };
            match row_inside && column_inside {
                true => within += z.norm_sqr(),
                false => beyond += z.norm_sqr(),
            }
        }
    }
    Some(10.0 * (beyond / within).log10())
}

fn upsampled_chip(
    fine: Vec<Complex64>,
    chip: &Chip,
    grid: &ImageGrid,
    first: [usize; 2],
    steps: [f64; 2],
) -> UpsampledChip {
    let finer =
        |axis: &subaperture_model::geometry::Axis, first: usize, step: f64, count: usize| {
            subaperture_model::geometry::Axis {
                start: axis.at(first),
                step: step / UPSAMPLING as f64,
                count: count * UPSAMPLING,
            }
        };
    let narrow = |z: &Complex64| num_complex::Complex32::new(z.re as f32, z.im as f32);
    UpsampledChip {
        image: Image {
            rows: chip.rows * UPSAMPLING,
            columns: chip.columns * UPSAMPLING,
            pixels: fine.iter().map(narrow).collect(),
        },
        grid: ImageGrid {
            rows: finer(&grid.rows, first[0], steps[0], chip.rows),
            columns: finer(&grid.columns, first[1], steps[1], chip.columns),
            ..*grid
        },
    }
}
