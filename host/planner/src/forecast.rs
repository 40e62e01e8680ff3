//! How long an image will take: the very former forms the middle of it from pulses in the middle of the recording
//! ([`subaperture_focus::forecast`]), operations by its own account of what it decides
//! ([`subaperture_focus::cost`]).

use subaperture_focus::forecast::{Forecast, Whole, fewer, grow};
use subaperture_focus::{Aim, Cost, FormError, ImageFormer, Misses, SCRATCH_BYTES, Task};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Stretch, Weights};

/// Most samples of a part: reading more takes time itself.
const MOST_SAMPLES: usize = 1 << 22;

/// Fewest pulses of a part, if there are so many.
const FEWEST_PULSES: usize = 64;

/// What `task` takes, whatever error that means. `None` of one that the former refuses: forming it says why.
pub fn cost(former: &dyn ImageFormer, task: &Task) -> Option<Cost> {
    let aim = Aim {
        collection: task.history.collection(),
        grid: task.grid,
        weights: task.weights,
        scratch_bytes: SCRATCH_BYTES,
        means: task.means,
    };
    let decision = former.decide(&aim, &former.asked(Misses::Allowed), task.monitor);
    Some(decision.ok()?.cost)
}

/// Measures a part of `task` and says how long all of it will take. `None` where it could not be formed: then the whole says why.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn forecast(former: &dyn ImageFormer, task: &Task) -> Result<Option<Forecast>, FormError> {
    match cost(former, task) {
        Some(cost) => forecast_of(former, task, &cost),
        None => Ok(None),
    }
}

/// The same of a task that takes `cost`.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn forecast_of(
    former: &dyn ImageFormer,
    task: &Task,
    cost: &Cost,
) -> Result<Option<Forecast>, FormError> {
    let collection = task.history.collection();
    let (all, width) = (collection.pulses.len(), collection.num_samples.max(1));
    let whole = Whole {
        operations: cost.operations.max(1.0),
        pulses: all,
        few_pulses: all.min((MOST_SAMPLES / width).max(FEWEST_PULSES)),
    };
    grow(&whole, task.monitor, |size| {
        let first = (all - size.pulses) / 2;
        let part = Stretch::new(task.history, first..first + size.pulses);
        let grid = middle_of(task.grid, size.side);
        let weights = Weights {
            fast: task.weights.fast.clone(),
            slow: task.weights.slow[part.pulses()].to_vec(),
        };
        let part_task = Task {
            history: &part,
            grid: &grid,
            weights: &weights,
            ..*task
        };
        let operations = self::cost(former, &part_task)?.operations.max(1.0);
        let form = move |monitor: &dyn Monitor| {
            let part_task = Task {
                history: &part,
                grid: &grid,
                weights: &weights,
                monitor,
                ..*task
            };
            // How well is no matter here.
            former.form_asked(&part_task, Misses::Allowed).map(drop)
        };
        Some((operations, form))
    })
}

/// The middle of a grid, `side` of each of its sides.
fn middle_of(grid: &ImageGrid, side: f64) -> ImageGrid {
    let middle = |axis: Axis| {
        let count = fewer(axis.count, side);
        let first = (axis.count - count) / 2;
        Axis {
            start: axis.at(first),
            count,
            ..axis
        }
    };
    ImageGrid {
        rows: middle(grid.rows),
        columns: middle(grid.columns),
        ..grid.clone()
    }
}
