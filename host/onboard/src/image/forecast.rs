//! How long an image of maps will take.

use super::{MapsTask, form};
use subaperture_focus::forecast::{Forecast, Whole, fewer, grow};
use subaperture_focus::{FormError, Misses};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;

/// Measures parts of `task`, fewer pixels all over the grid, and says how long all of it will take. `None` where no part could be
/// formed: then the whole says why.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn forecast(task: &MapsTask) -> Result<Option<Forecast>, FormError> {
    // Every map is read once, and every pixel looks into as many; what one look takes is the same everywhere.
    let whole = Whole {
        operations: task.grid.num_pixels() as f64 * task.maps.headers().len() as f64,
        pulses: 1,
        few_pulses: 1,
    };
    grow(&whole, task.monitor, |size| {
        let grid = coarser(task.grid, size.side);
        let operations = grid.num_pixels() as f64 * task.maps.headers().len() as f64;
        let form = move |monitor: &dyn Monitor| {
            let part_task = MapsTask {
                grid: &grid,
                misses: Misses::Allowed,
                monitor,
                ..*task
            };
            form(&part_task).map(drop)
        };
        Some((operations, form))
    })
}

/// A grid of fewer pixels that covers the same, `side` of each of its sides' pixels.
fn coarser(grid: &ImageGrid, side: f64) -> ImageGrid {
    let wider = |axis: Axis| {
        let count = fewer(axis.count, side);
        let steps = axis.count.saturating_sub(1) as f64 / count.saturating_sub(1).max(1) as f64;
        Axis {
            step: axis.step * steps.max(1.0),
            count,
            ..axis
        }
    };
    ImageGrid {
        rows: wider(grid.rows),
        columns: wider(grid.columns),
        ..grid.clone()
    }
}
