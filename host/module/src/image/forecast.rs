//! Forecast of the image formation time.

use super::{MapsTask, form};
use subaperture_focus::forecast::{Forecast, WorkSize, fewer, grow};
use subaperture_focus::{BoundPolicy, FormError};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;

/// Forecast the duration of `task` from measurements with fewer pixels across the grid. `None` if no part could be formed:
/// forming the image then reports the reason.
///
/// # Errors
/// [`FormError::Cancelled`] if the user cancels.
pub fn forecast(task: &MapsTask) -> Result<Option<Forecast>, FormError> {
    // Every map is read once and every pixel evaluates the same number of maps, at the same cost.
    let whole = WorkSize {
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
                bound_policy: BoundPolicy::Allowed,
                monitor,
                ..*task
            };
            form(&part_task).map(drop)
        };
        Some((operations, form))
    })
}

/// Grid with the same extent and `side` times the number of pixels along each side.
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
