//! The strongest points of an image, each apart from the side lobes of those before it.
//!
//! The image is read once, part by part, and of each cell of it the brightest pixel kept. These are measured from the brightest down, but
//! those that lie where an already measured point's side lobes are looked for ([`super::SPAN_WIDTHS`] widths along both axes of the grid): there a
//! point is not told from a side lobe. Further out along these axes those are passed over that are no brighter than side lobes can be there:
//! without a window these fall as `0.36 w / d` of the peak's amplitude, at `d` from a peak `w` wide at half its power, and 3.5 dB are allowed
//! beside. What is no point, or too near the border to be measured, is passed over.
//!
//! Two points nearer to each other than that are told as the stronger one. Memory: a cell's brightest pixel, 24 bytes, of a million cells at the
//! most, and a chip.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Parts, power};

use super::error::unreadable;
use super::measurement::measure_in;
use super::{Response, ResponseError, Settings, Target};

/// Side of a cell, pixels, of an image of up to [`MOST_CELLS`] of them.
const CELL: usize = 8;

/// Cells at the most: those of larger images are larger.
const MOST_CELLS: usize = 1 << 20;

/// How far around what is no point nothing else is looked for, pixels.
const APART_PX: f64 = 16.0;

/// Pixels that are tried for a point that is asked for.
const TRIES: usize = 8;

/// Points that were found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Strongest {
    /// From the strongest down; fewer than asked where the image has no more.
    pub points: Vec<Response>,
    /// Why bright pixels before the last of them are no points: row, column, reason.
    pub passed_over: Vec<(usize, usize, ResponseError)>,
}

/// Of a peak's amplitude and its width at half its power, what side lobes of a band without a window reach, times the distance: `sin x / x`
/// is 0.886 of a null's distance wide, and falls as `1 / x`; 1.5 times that.
const SIDE_LOBES: f64 = 1.5 / (0.886 * std::f64::consts::PI);

/// A rectangle of pixels in which no further point is looked for.
struct Taken {
    row: f64,
    column: f64,
    half: [f64; 2],
    /// Amplitude of a point times its widths along rows and columns, pixels; of what is no point 0.
    lobes: [f64; 2],
}

impl Taken {
    /// Whether a pixel of this power lies there, or may be a side lobe further out.
    fn has(&self, row: usize, column: usize, power: f64) -> bool {
        let off = [row as f64 - self.row, column as f64 - self.column].map(f64::abs);
        let within = [off[0] <= self.half[0], off[1] <= self.half[1]];
        let lobe = |i: usize| power.sqrt() * off[i] <= SIDE_LOBES * self.lobes[i];
        match within {
            [true, true] => true,
            [false, true] => lobe(0),
            [true, false] => lobe(1),
            [false, false] => false,
        }
    }

    /// Where the side lobes of a point are looked for.
    fn of(response: &Response, grid: &ImageGrid) -> Self {
        let reach = |cut: usize, step: f64| {
            let [low, high] = response.cuts[cut].span;
            (low.abs().max(high.abs()) / step).max(APART_PX)
        };
        // The cuts along x, and along y: of a polar grid in radians and metres, as the axes.
        Self {
            row: response.row,
            column: response.column,
            half: [reach(1, grid.rows.step), reach(0, grid.columns.step)],
            lobes: [(1, grid.rows.step), (0, grid.columns.step)].map(|(cut, step)| {
                let width = response.cuts[cut].width_3db.unwrap_or(0.0);
                10f64.powf(response.level_db / 20.0) * (width / step).abs()
            }),
        }
    }
}

/// The `count` strongest points of an image.
///
/// # Errors
/// [`ResponseError::Unreadable`], [`ResponseError::Unsuited`] of an image that is not the grid's, and [`ResponseError::TooCoarse`].
pub fn strongest(
    image: &dyn Parts,
    grid: &ImageGrid,
    count: usize,
    settings: &Settings<'_>,
) -> Result<Strongest, ResponseError> {
    let mut found = Strongest {
        points: Vec::new(),
        passed_over: Vec::new(),
    };
    let mut taken: Vec<Taken> = Vec::new();
    let mut tries = TRIES * count;
    for (power, row, column) in brightest_of_cells(image)? {
        if found.points.len() == count || tries == 0 {
            break;
        }
        if taken.iter().any(|taken| taken.has(row, column, power)) {
            continue;
        }
        tries -= 1;
        let target = Target::Near {
            column_value: grid.columns.at(column),
            row_value: grid.rows.at(row),
        };
        match measure_in(image, grid, target, settings) {
            Ok(response) => {
                // The brightest near by may be a point that is known.
                let at = [
                    response.row.round() as usize,
                    response.column.round() as usize,
                ];
                let power = 10f64.powf(response.level_db / 10.0);
                if !taken.iter().any(|taken| taken.has(at[0], at[1], power)) {
                    taken.push(Taken::of(&response, grid));
                    found.points.push(response);
                } else {
                    taken.push(around(row, column));
                }
            }
            Err(error @ (ResponseError::Border { .. } | ResponseError::NoPeak { .. })) => {
                found.passed_over.push((row, column, error));
                taken.push(around(row, column));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

fn around(row: usize, column: usize) -> Taken {
    Taken {
        row: row as f64,
        column: column as f64,
        half: [APART_PX; 2],
        lobes: [0.0; 2],
    }
}

/// Power, row and column of the brightest pixel of each cell that has one above zero, from the brightest down; of equals the first.
fn brightest_of_cells(image: &dyn Parts) -> Result<Vec<(f64, usize, usize)>, ResponseError> {
    let (rows, columns) = image.size();
    let even = (rows as f64 * columns as f64 / MOST_CELLS as f64).sqrt();
    let cell = CELL.max(even.ceil() as usize);
    let across = columns.div_ceil(cell);
    let mut cells = vec![(0.0, 0, 0); rows.div_ceil(cell) * across];
    for place in image.places() {
        let part = image.window(&place).map_err(unreadable)?;
        for (i, &z) in part.pixels.iter().enumerate() {
            let row = place[0].start + i / part.columns;
            let column = place[1].start + i % part.columns;
            let best = &mut cells[row / cell * across + column / cell];
            let power = power(z);
            if power > best.0 && power.is_finite() {
                *best = (power, row, column);
            }
        }
    }
    cells.retain(|(power, ..)| *power > 0.0);
    cells.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;
    use subaperture_model::geometry::{Axis, ImageGrid};
    use subaperture_model::image::Image;

    use super::*;

    const SIDE: usize = 200;

    /// Points of a band that fills half of what pixels hold: `sinc` of both axes, with side lobes of -13 dB.
    fn image(points: &[(f64, f64, f32)]) -> (Image, ImageGrid) {
        let sinc = |x: f64| match x == 0.0 {
            true => 1.0,
            false => (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x),
        };
        let mut pixels = vec![Complex32::default(); SIDE * SIDE];
        for &(row, column, amplitude) in points {
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let (r, c) = ((i / SIDE) as f64 - row, (i % SIDE) as f64 - column);
                *pixel += amplitude * (sinc(0.5 * r) * sinc(0.5 * c)) as f32;
            }
        }
        let axis = Axis {
            start: -10.0,
            step: 0.1,
            count: SIDE,
        };
        let image = Image {
            rows: SIDE,
            columns: SIDE,
            pixels,
        };
        (image, ImageGrid::horizontal(axis, axis, 0.0))
    }

    #[test]
    fn points_come_from_the_strongest_down_and_no_side_lobe_is_one() {
        // The weakest is far below the side lobes of the strongest, near it.
        let points = [(50.0, 60.0, 1.0), (150.3, 140.0, 0.5), (60.0, 150.0, 0.02)];
        let (image, grid) = image(&points);
        let found = strongest(&image, &grid, 3, &Settings::default()).unwrap();
        let at: Vec<(f64, f64)> = found.points.iter().map(|p| (p.row, p.column)).collect();
        assert_eq!(at.len(), 3, "{at:?}");
        for ((row, column), (r, c, _)) in at.iter().zip(points) {
            assert!((row - r).abs() < 0.1 && (column - c).abs() < 0.1, "{at:?}");
        }
        let levels: Vec<f64> = found.points.iter().map(|p| p.level_db).collect();
        assert!((levels[0] - levels[1] - 6.02).abs() < 0.2, "{levels:?}");
        // One is asked for, and one found.
        let one = strongest(&image, &grid, 1, &Settings::default()).unwrap();
        assert_eq!(one.points.len(), 1);
        let none = strongest(&image, &grid, 0, &Settings::default()).unwrap();
        assert!(none.points.is_empty());
    }

    #[test]
    fn what_lies_at_the_border_is_passed_over_and_an_empty_image_has_none() {
        let (image, grid) = image(&[(1.0, 100.0, 1.0), (120.0, 100.0, 0.3)]);
        let found = strongest(&image, &grid, 1, &Settings::default()).unwrap();
        assert_eq!(found.points[0].row.round(), 120.0);
        assert_eq!((found.passed_over[0].0, found.passed_over[0].1), (1, 100));
        let dark = Image {
            pixels: vec![Complex32::default(); SIDE * SIDE],
            ..image
        };
        let found = strongest(&dark, &grid, 5, &Settings::default()).unwrap();
        assert!(found.points.is_empty());
    }
}
