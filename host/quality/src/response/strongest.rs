//! Detection of the strongest points of an image, excluding sidelobes of stronger points.
//!
//! The image is read once, and the brightest pixel of each cell is kept. These pixels are measured in descending order, except
//! those within the sidelobe span of a measured point ([`super::SPAN_WIDTHS`] widths along both grid axes), where a
//! point and a sidelobe cannot be distinguished. Beyond the span along these axes, pixels no brighter than a possible sidelobe are skipped:
//! unweighted sidelobes fall as `0.36 w / d` of the peak's amplitude, at distance `d` from a peak of 3 dB width `w`, plus a margin of 3.5 dB.
//! Pixels that are no points, or too close to the border, are skipped.
//!
//! Of two points closer than the span, the stronger is reported. **Memory** 24 bytes per cell, at most a million cells,
//! and a chip.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{ImageSource, power};

use super::error::unreadable;
use super::measurement::measure_in;
use super::{Response, ResponseError, Settings, Target};

/// Side of a cell, pixels, for an image of up to [`MAX_CELLS`] cells.
const CELL: usize = 8;

/// Largest number of cells; larger images have larger cells.
const MAX_CELLS: usize = 1 << 20;

/// Exclusion radius around a pixel that is no point, pixels.
const APART_PX: f64 = 16.0;

/// Candidate pixels per requested point.
const TRIES: usize = 8;

/// Detected points.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Strongest {
    /// Responses in descending order; fewer than requested if the image has no more.
    pub points: Vec<Response>,
    /// Skipped bright pixels: row, column, reason.
    pub passed_over: Vec<(usize, usize, ResponseError)>,
}

/// Sidelobe envelope of an unweighted band times distance, relative to peak amplitude times 3 dB width: `sin x / x`
/// has a width of 0.886 null distances and falls as `1 / x`; margin 1.5.
const SIDE_LOBES: f64 = 1.5 / (0.886 * std::f64::consts::PI);

/// Excluded rectangle around a point.
struct Taken {
    row: f64,
    column: f64,
    half: [f64; 2],
    /// Amplitude times 3 dB widths along rows and columns, pixels; 0 for no point.
    lobes: [f64; 2],
}

impl Taken {
    /// Whether a pixel of this power is excluded: inside the rectangle, or possibly a sidelobe beyond it.
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

    /// Sidelobe span of a point.
    fn of(response: &Response, grid: &ImageGrid) -> Self {
        let reach = |cut: usize, step: f64| {
            let [low, high] = response.cuts[cut].span;
            (low.abs().max(high.abs()) / step).max(APART_PX)
        };
        // Cuts along x and y; on a polar grid in radians and metres, as the axes.
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

/// Find the `count` strongest points of an image.
///
/// # Errors
/// [`ResponseError::Unreadable`]; [`ResponseError::Unsuited`] if image and grid differ in size; [`ResponseError::TooCoarse`].
pub fn strongest(
    image: &dyn ImageSource,
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
    for (power, row, column) in brightest_of_cells(image, settings.memory_bytes)? {
        let (row, column) = (row as usize, column as usize);
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
                // The brightest neighbour may be a known point.
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

/// Power, row and column of the brightest pixel of each cell with power, in descending order; of equal pixels the first.
fn brightest_of_cells(
    image: &dyn ImageSource,
    memory_bytes: u64,
) -> Result<Vec<(f64, u32, u32)>, ResponseError> {
    let (rows, columns) = image.size();
    let even = (rows as f64 * columns as f64 / MAX_CELLS as f64).sqrt();
    let cell = CELL.max(even.ceil() as usize);
    let across = columns.div_ceil(cell);
    let count = rows.div_ceil(cell) * across;
    let needed_bytes = (count * size_of::<(f64, u32, u32)>()) as u64;
    if needed_bytes > memory_bytes {
        return Err(ResponseError::Memory {
            needed_bytes,
            allowed_bytes: memory_bytes,
        });
    }
    let mut cells = vec![(0.0, 0, 0); count];
    for place in image.places() {
        let part = image.window(&place).map_err(unreadable)?;
        for (i, &z) in part.pixels.iter().enumerate() {
            let row = place[0].start + i / part.columns;
            let column = place[1].start + i % part.columns;
            let best = &mut cells[row / cell * across + column / cell];
            let power = power(z);
            if power > best.0 && power.is_finite() {
                *best = (power, row as u32, column as u32);
            }
        }
    }
    cells.retain(|(power, ..)| *power > 0.0);
    cells.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;
    use subaperture_model::geometry::{Axis, ImageGrid};
    use subaperture_model::image::Image;

    use super::*;

    const SIDE: usize = 200;

    /// Points with a uniform band of half a cycle per pixel: `sinc` along both axes, sidelobes -13 dB.
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
    fn points_are_found_in_descending_order_without_sidelobes() {
        // The weakest is far below the sidelobes of the nearby strongest.
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
        // One requested, one found.
        let one = strongest(&image, &grid, 1, &Settings::default()).unwrap();
        assert_eq!(one.points.len(), 1);
        let none = strongest(&image, &grid, 0, &Settings::default()).unwrap();
        assert!(none.points.is_empty());
    }

    #[test]
    fn border_points_are_skipped_and_empty_image_has_no_points() {
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
