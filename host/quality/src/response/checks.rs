//! Preconditions of a point measurement: matching image and grid, sufficient sampling, a distinct peak.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::resolution::support::Looks;

use super::{MAX_FILLED, MIN_PEAK_DB, ResponseError};

/// Check that image and grid have the same size.
pub(super) fn check_shape(image: &Image, grid: &ImageGrid) -> Result<(), ResponseError> {
    let (rows, columns) = (image.rows, image.columns);
    if (rows, columns) != (grid.rows.count, grid.columns.count)
        || rows.checked_mul(columns) != Some(image.pixels.len())
    {
        return Err(ResponseError::Unsuited(format!(
            "expected an image of its grid's size, found {rows} rows x {columns} columns with {} pixels, and a grid of {} x {}",
            image.pixels.len(),
            grid.rows.count,
            grid.columns.count
        )));
    }
    Ok(())
}

/// Check that the pixel spacing samples the spectral support at a pixel.
pub(super) fn check_sampling(
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
        if axis.step * extent > MAX_FILLED {
            return Err(ResponseError::TooCoarse {
                along,
                at: axis.at(i),
                step: axis.step,
                needed: MAX_FILLED / extent,
                extent,
            });
        }
    }
    Ok(())
}

/// Check that the brightest pixel stands out of the background.
pub(super) fn check_peak(
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
    match above_db < MIN_PEAK_DB {
        true => Err(ResponseError::NoPeak {
            row,
            column,
            above_db,
        }),
        false => Ok(()),
    }
}
