//! Forecast of processing time: the former forms the centre of the image from pulses in the middle of the recording
//! ([`subaperture_focus::forecast`]); the time is scaled by the former's operation count
//! ([`subaperture_focus::cost`]), with the operations of comparing the image with the exact sum.

use subaperture_focus::accuracy::comparison_cost;
use subaperture_focus::forecast::{Forecast, WorkSize, fewer, grow};
use subaperture_focus::{BoundPolicy, Cost, FormError, ImageFormer, Task};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, PulseRange, Weights};
use subaperture_signal::window::Window;

/// Largest number of samples in the trial; reading more takes time itself.
const MAX_SAMPLES: usize = 1 << 22;

/// Smallest number of pulses in the trial, if the recording has as many.
const MIN_PULSES: usize = 64;

/// Cost of `task`, whatever its error. `None` if the former refuses the task; forming it gives the reason.
pub fn cost(former: &dyn ImageFormer, task: &Task) -> Option<Cost> {
    let decision = former.decide(
        &task.spec(),
        &former.goal(BoundPolicy::Allowed),
        task.monitor,
    );
    Some(decision.ok()?.cost)
}

/// Real operations of `task` in all, by its plan's `cost`: those of the plan, and those of comparing the image with the exact sum in two
/// passes over the pulses.
pub fn operations(task: &Task, cost: &Cost) -> f64 {
    (cost.operations + comparison_cost(&task.spec()).operations).max(1.0)
}

/// Time a part of `task` and extrapolate to the whole. `None` if the part could not be formed; forming the task gives the reason.
///
/// # Errors
/// [`FormError::Cancelled`] if the monitor cancels.
pub fn forecast(former: &dyn ImageFormer, task: &Task) -> Result<Option<Forecast>, FormError> {
    match cost(former, task) {
        Some(cost) => forecast_of(former, task, &cost),
        None => Ok(None),
    }
}

/// As [`forecast`], for a task of known cost.
///
/// # Errors
/// [`FormError::Cancelled`] if the monitor cancels.
pub fn forecast_of(
    former: &dyn ImageFormer,
    task: &Task,
    cost: &Cost,
) -> Result<Option<Forecast>, FormError> {
    let collection = task.history.collection();
    let (all, width) = (collection.pulses.len(), collection.num_samples.max(1));
    let whole = WorkSize {
        operations: operations(task, cost),
        pulses: all,
        few_pulses: all.min((MAX_SAMPLES / width).max(MIN_PULSES)),
    };
    grow(&whole, task.monitor, |size| {
        let first = (all - size.pulses) / 2;
        let part = PulseRange::new(task.history, first..first + size.pulses);
        let grid = middle_of(task.grid, size.side);
        let weights = match &task.weights.illumination {
            None => Weights {
                fast: task.weights.fast.clone(),
                slow: task.weights.slow[part.pulses()].to_vec(),
                illumination: None,
                windows: None,
            },
            // The blocks of the part; windows take no time.
            Some(_) => {
                let collection = part.collection();
                let weights = former.weights(collection, &grid, Window::None, Window::None);
                weights.ok()?
            }
        };
        let part_task = Task {
            history: &part,
            grid: &grid,
            weights: &weights,
            ..*task
        };
        let operations = operations(&part_task, &self::cost(former, &part_task)?);
        let form = move |monitor: &dyn Monitor| {
            let part_task = Task {
                history: &part,
                grid: &grid,
                weights: &weights,
                monitor,
                ..*task
            };
            // The error of the trial does not matter.
            former
                .form_asked(&part_task, BoundPolicy::Allowed)
                .map(drop)
        };
        Some((operations, form))
    })
}

/// Central part of a grid, a fraction `side` of each side.
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
