//! How long an image will take: the very former forms the middle of it from pulses in the middle of the recording
//! ([`subaperture_focus::forecast`]), operations by the formers' own accounts ([`super::cost`]).

use super::cost::{Cost, Work};
use super::radar::{self, RadarPlan};
use subaperture_focus::forecast::{Forecast, Whole, fewer, grow};
use subaperture_focus::rdbp::thesis::SUB_CPI as THESIS_SUB_CPI;
use subaperture_focus::{FormError, ImageFormer, Misses, Task};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Stretch, Weights};

/// Most samples of a part: reading more takes time itself.
const MOST_SAMPLES: usize = 1 << 22;

/// Fewest pulses of a part, if there are so many.
const FEWEST_PULSES: usize = 64;

/// What is to be formed, as far as its operations depend on it.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Bound on the error, dB.
    pub error_db: f64,
    /// Pulses a sub-CPI, if given.
    pub sub_cpi: Option<usize>,
    /// Whether it is the thesis's mode.
    pub is_thesis: bool,
}

impl Settings {
    /// Those of a former that chooses everything by its bound, dB.
    pub fn within(error_db: f64) -> Self {
        Self {
            error_db,
            sub_cpi: None,
            is_thesis: false,
        }
    }
}

/// What a former called `name` takes, by its account.
///
/// `None` of a former without one, or where the collection does not suit it.
pub fn cost(
    name: &str,
    collection: &Collection,
    grid: &ImageGrid,
    settings: &Settings,
    memory_bytes: u64,
) -> Option<Cost> {
    let work = Work {
        frequencies: collection.num_samples,
        pulses: collection.pulses.len(),
        pixels: grid.num_pixels(),
    };
    match name {
        "exact" => Some(Cost::exact(&work)),
        "bp" | "velocity" => Some(Cost::backprojection(&work, settings.error_db)),
        "rdbp" if settings.is_thesis => {
            let sub_cpi = settings.sub_cpi.unwrap_or(THESIS_SUB_CPI);
            Some(Cost::thesis(&work, sub_cpi.min(work.pulses)))
        }
        _ => {
            let request = radar::Request {
                grid,
                error_db: settings.error_db,
                memory_bytes: memory_bytes / 2,
                thesis_sub_cpi: THESIS_SUB_CPI,
                beamwidth_rad: None,
                power: None,
            };
            let plan = RadarPlan::new(collection, &request).ok()?;
            plan.costs.into_iter().find(|cost| cost.algorithm == name)
        }
    }
}

/// Measures a part of `task` and says how long all of it will take. `None` where the former has no account of its
/// operations, or its part could not be formed: then the whole says why.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn forecast(
    former: &dyn ImageFormer,
    task: &Task,
    settings: &Settings,
) -> Result<Option<Forecast>, FormError> {
    let collection = task.history.collection();
    let count = |collection: &Collection, grid: &ImageGrid| {
        let cost = cost(former.name(), collection, grid, settings, task.memory_bytes);
        cost.map(|cost| cost.operations).filter(|n| *n > 0.0)
    };
    let Some(operations) = count(collection, task.grid) else {
        return Ok(None);
    };
    let (all, width) = (collection.pulses.len(), collection.num_samples.max(1));
    let whole = Whole {
        operations,
        pulses: all,
        few_pulses: all.min((MOST_SAMPLES / width).max(FEWEST_PULSES)),
    };
    grow(&whole, task.monitor, |size| {
        let first = (all - size.pulses) / 2;
        let part = Stretch::new(task.history, first..first + size.pulses);
        let grid = middle_of(task.grid, size.side);
        let operations = count(PhaseHistory::collection(&part), &grid)?;
        let form = move |monitor: &dyn Monitor| {
            let weights = Weights {
                fast: task.weights.fast.clone(),
                slow: task.weights.slow[part.pulses()].to_vec(),
            };
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
        ..*grid
    }
}
