//! Measurement of a point in its chip: peak, cuts, and two-dimensional sidelobes.

use std::ops::Range;

use num_complex::{Complex32, Complex64};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, ImageSource};

use super::carrier::Carrier;
use super::checks::{check_peak, check_sampling, check_shape};
use super::chip::Chip;
use super::error::unreadable;
use super::search::brightest_in;
use super::size::{Size, chip_size, reach_px};
use super::{Cut, Direction, Response, ResponseError, Settings, Target, UPSAMPLING, UpsampledChip};

/// Measure the impulse response of a point in `image`.
///
/// # Errors
/// [`ResponseError`] if the point is outside, too close to the border, undersampled, not distinct, or not finite.
pub fn measure(
    image: &Image,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<Response, ResponseError> {
    check_shape(image, grid)?;
    match (settings.carrier, &grid.relief) {
        (Some(carrier), Some(_)) => measure_on_surface(image, grid, target, settings, &carrier),
        _ => measure_even(image, grid, target, settings),
    }
}

/// [`measure`] on a relief, whose slopes make the phase gradient uneven: the phase contribution of the
/// heights is removed before the measurement, and restored at the peak.
fn measure_on_surface(
    image: &Image,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
    carrier: &Carrier,
) -> Result<Response, ResponseError> {
    if let Some(looks) = settings.looks {
        check_sampling(looks, grid, brightest_in(image, grid, target, settings)?)?;
    }
    let flat = grid.flat();
    let added_rad = |row_value: f64, column_value: f64| {
        let [on, under] = [grid, &flat].map(|grid| {
            let point = grid.point_m(row_value, column_value);
            2.0 * point.distance(carrier.antenna_m) / carrier.wavelength_m
        });
        std::f64::consts::TAU * (on - under).fract()
    };
    let mut level = image.clone();
    for (i, pixel) in level.pixels.iter_mut().enumerate() {
        let (row, column) = (i / image.columns, i % image.columns);
        let turned = added_rad(grid.rows.at(row), grid.columns.at(column));
        let turned = Complex64::new(pixel.re.into(), pixel.im.into()) * Complex64::cis(-turned);
        *pixel = Complex32::new(turned.re as f32, turned.im as f32);
    }
    let settings = Settings {
        looks: None,
        ..*settings
    };
    let mut response = measure_even(&level, &flat, target, &settings)?;
    let (row_value, column_value) = (response.row_value, response.column_value);
    response.position_m = grid.point_m(row_value, column_value).to_array();
    let phase = response.phase_rad + added_rad(row_value, column_value);
    response.phase_rad = Complex64::cis(phase).arg();
    let turns = [grid, &flat].map(|grid| carrier.turn(grid, row_value, column_value));
    if let [Some(on), Some(under)] = turns {
        for i in 0..2 {
            response.turn[i] += on[i] - under[i];
        }
    }
    Ok(response)
}

/// [`measure`] for an even phase gradient.
fn measure_even(
    image: &Image,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<Response, ResponseError> {
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
    // Phase step per image pixel; a chip pixel may span several.
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

    // Spacing of the chip's pixels.
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
    let islr_2d_db = integrated_2d_db(&chip, half, [y, x], &cuts, steps);
    let first = [row - half[0] * stride[0], column - half[1] * stride[1]];
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
        chip: UpsampledChip::new(chip, grid, first, steps),
    })
}

/// [`measure`] for an image that does not fit in memory: reads the pixels within [`super::REACH_WIDTHS`] 3 dB widths of the point, at most
/// 2048 pixels to each side.
///
/// # Errors
/// As [`measure`]; [`ResponseError::Unreadable`].
pub fn measure_in(
    image: &dyn ImageSource,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<Response, ResponseError> {
    let (row, column) = brightest_in(image, grid, target, settings)?;
    let reach = reach_px(image, (row, column))?;
    let side = 2 * reach as u64 + 1;
    // On a relief the window is held twice.
    let needed_bytes = 16 * side.min(grid.rows.count as u64) * side.min(grid.columns.count as u64);
    if needed_bytes > settings.memory_bytes {
        return Err(ResponseError::Memory {
            needed_bytes,
            allowed_bytes: settings.memory_bytes,
        });
    }
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
        ..grid.clone()
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

/// Directions of the cuts, in rows and columns per unit of length; `steps` are those of the chip.
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

/// Cut through the peak along a direction, `length` to either side, relative to the power `top` of the peak.
fn cut(
    chip: &Chip,
    [y, x]: [f64; 2],
    (along, pixels): (Direction, [f64; 2]),
    length: f64,
    top: f64,
    settings: &Settings<'_>,
) -> Cut {
    // Sampled as finely as the upsampled chip along the faster axis.
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

/// Length of a line through the peak inside the chip, to both sides.
fn cut_length(pixels: [f64; 2], peak: [f64; 2], half: [usize; 2]) -> f64 {
    (0..2)
        .filter(|&i| pixels[i].abs() > 1e-12)
        .map(|i| (half[i] as f64 - peak[i].abs()) / pixels[i].abs())
        .fold(f64::INFINITY, f64::min)
}

/// Two-dimensional ISLR, dB: energy outside the rectangle of the first minima over that inside, within the spans of the cuts.
fn integrated_2d_db(
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
    chip.fine_rows(UPSAMPLING, 0..chip.rows * UPSAMPLING, |i, row| {
        let Some(row_inside) = inside(i, 0, down) else {
            return;
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
    });
    Some(10.0 * (beyond / within).log10())
}
