//! Search for the brightest pixel of an image or near a position.

use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{ImageSource, peak_of, power};

use super::error::unreadable;
use super::{ResponseError, Settings, Target};

/// Row and column of the brightest pixel of a target.
///
/// # Errors
/// [`ResponseError::Unsuited`] if no pixel is above zero or the position is outside; [`ResponseError::Unreadable`].
pub fn brightest_in(
    image: &dyn ImageSource,
    grid: &ImageGrid,
    target: Target,
    settings: &Settings<'_>,
) -> Result<(usize, usize), ResponseError> {
    if image.size() != (grid.rows.count, grid.columns.count) {
        let (rows, columns) = image.size();
        return Err(ResponseError::Unsuited(format!(
            "expected an image of its grid's size, found {rows} rows x {columns} columns and a grid of {} x {}",
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
    // Of equal pixels, the position given.
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

/// Pixel nearest to grid coordinates.
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
