//! How long an image will take: a part of the same work, measured on this machine.
//!
//! The very former forms the middle of the image from pulses in the middle of the recording, in larger and larger parts
//! until one takes 0.3 s or 1.5 s have passed. With the operations of the parts and of the whole by the formers' own accounts
//! ([`super::cost`]), and `slope` the time of an operation more from the last part but one to the last, the estimate is
//!
//! ```text
//! time = time(part) + slope * (operations(whole) - operations(part))
//! ```
//!
//! Counts are not times: what a part of a large image keeps in caches the whole may not. Checked on recordings of every former
//! (`tests/forecast.rs`): within a factor of 2.

use std::iter::Sum;
use std::ops::Range;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use num_complex::Complex32;

use super::cost::{Cost, Work};
use super::radar::{self, RadarPlan};
use crate::focus::maps::{self, MapsTask};
use crate::focus::{FormError, ImageFormer, Misses, Monitor, Task, Weights};
use crate::geometry::{Axis, ImageGrid};
use crate::phase_history::{Collection, PhaseHistory, Stretch};

/// A part that takes so long is large enough.
const LONG_ENOUGH_S: f64 = 0.3;

/// No part takes longer: one that does is stopped, and its time is that of what it did.
const MOST_S: f64 = 1.5;

/// Time of an operation more over that of a part's in the mean, at the least: differences of short times say little.
const LEAST_SLOPE: f64 = 0.25;

/// Operations of the first part.
const FIRST_OPERATIONS: f64 = 1e7;

/// Most samples of a part: reading more takes time itself.
const MOST_SAMPLES: usize = 1 << 22;

/// Samples read at a time.
const BLOCK_SAMPLES: usize = 1 << 17;

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

/// An estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Of the whole work, seconds.
    pub seconds: f64,
    /// That the part measured took, seconds.
    pub measured_s: f64,
}

impl Sum for Forecast {
    /// Of work done one after another.
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(
            Self {
                seconds: 0.0,
                measured_s: 0.0,
            },
            |sum, part| Self {
                seconds: sum.seconds + part.seconds,
                measured_s: sum.measured_s + part.measured_s,
            },
        )
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
            let sub_cpi = settings.sub_cpi.unwrap_or(crate::crosscheck::SUB_CPI);
            Some(Cost::thesis(&work, sub_cpi.min(work.pulses)))
        }
        _ => {
            let request = radar::Request {
                grid,
                error_db: settings.error_db,
                memory_bytes: memory_bytes / 2,
                thesis_sub_cpi: crate::crosscheck::SUB_CPI,
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
        let operations = count(part.collection(), &grid)?;
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

/// As [`forecast`], of an image of a module's maps: from fewer pixels all over the grid.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn forecast_of_maps(task: &MapsTask) -> Result<Option<Forecast>, FormError> {
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
            maps::form(&part_task).map(drop)
        };
        Some((operations, form))
    })
}

/// How much of a work.
#[derive(Clone, Copy)]
struct Size {
    /// Of each of the grid's sides.
    side: f64,
    pulses: usize,
}

/// All of a work.
struct Whole {
    operations: f64,
    pulses: usize,
    /// Pulses of its first parts: more are taken once a part has all pixels.
    few_pulses: usize,
}

/// Measures larger and larger parts of a work. `part` says how many operations a part has, and what does it.
fn grow<F: FnOnce(&dyn Monitor) -> Result<(), FormError>>(
    whole: &Whole,
    monitor: &dyn Monitor,
    part: impl Fn(Size) -> Option<(f64, F)>,
) -> Result<Option<Forecast>, FormError> {
    let mut size = Size {
        side: (FIRST_OPERATIONS / whole.operations).sqrt().min(1.0),
        pulses: whole.few_pulses,
    };
    let begun = Instant::now();
    let mut smaller = None;
    loop {
        let Some((operations, form)) = part(size) else {
            return Ok(None);
        };
        let until = Until {
            monitor,
            deadline: Instant::now() + Duration::from_secs_f64(MOST_S),
            fraction: Mutex::new(0.0),
        };
        let start = Instant::now();
        let formed = form(&until);
        let measured_s = start.elapsed().as_secs_f64();
        let done = match formed {
            Ok(()) => 1.0,
            Err(FormError::Cancelled) if monitor.cancelled() => return Err(FormError::Cancelled),
            Err(FormError::Cancelled) => until.done(),
            Err(_) => return Ok(None),
        };
        let is_whole = size.side >= 1.0 && size.pulses == whole.pulses;
        let is_enough = measured_s >= LONG_ENOUGH_S && smaller.is_some();
        if is_enough || is_whole || done < 1.0 || begun.elapsed().as_secs_f64() > MOST_S {
            // What was stopped before it told of any progress says only that it is long.
            let seconds = measured_s / done.max(1e-3);
            // What a part takes beside its operations, to plan and to begin, it took before too.
            let mean = seconds / operations;
            let slope = match smaller {
                Some((before, took_s)) if before < operations => {
                    (seconds - took_s) / (operations - before)
                }
                _ => mean,
            };
            let more_s = (whole.operations - operations) * slope.clamp(LEAST_SLOPE * mean, mean);
            return Ok(Some(Forecast {
                seconds: seconds + more_s,
                measured_s,
            }));
        }
        smaller = Some((operations, measured_s));
        let more = (LONG_ENOUGH_S * 1.5 / measured_s.max(1e-4)).clamp(4.0, 64.0);
        if size.side < 1.0 {
            size.side = (size.side * more.sqrt()).min(1.0);
        } else {
            size.pulses = whole.pulses.min((size.pulses as f64 * more) as usize + 1);
        }
    }
}

/// How long it takes to read all of so many pulses of `width` samples, by reading some of them here and there.
///
/// # Errors
/// Those of `read`.
pub fn reading<E>(
    num_pulses: usize,
    width: usize,
    read: impl Fn(Range<usize>, &mut [Complex32]) -> Result<(), E>,
) -> Result<Forecast, E> {
    let block = (BLOCK_SAMPLES / width.max(1)).clamp(1, num_pulses.max(1));
    let mut samples = vec![Complex32::ZERO; block * width];
    let (begun, mut done) = (Instant::now(), 0);
    let blocks = num_pulses.div_ceil(block);
    // A prime stride, so that neighbours are not read one after the other.
    for index in (0..blocks).map(|i| i * 7919 % blocks) {
        let first = index * block;
        let pulses = first..num_pulses.min(first + block);
        done += pulses.len();
        let samples = &mut samples[..pulses.len() * width];
        read(pulses, samples)?;
        if begun.elapsed().as_secs_f64() > LONG_ENOUGH_S {
            break;
        }
    }
    let measured_s = begun.elapsed().as_secs_f64();
    Ok(Forecast {
        seconds: measured_s * num_pulses as f64 / done.max(1) as f64,
        measured_s,
    })
}

/// `side` of the elements of an axis; two where it has as many.
fn fewer(count: usize, side: f64) -> usize {
    ((count as f64 * side).ceil() as usize).clamp(count.min(2), count)
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
        ..*grid
    }
}

/// Stops work at a time, and keeps how far it was.
struct Until<'a> {
    monitor: &'a dyn Monitor,
    deadline: Instant,
    fraction: Mutex<f64>,
}

impl Until<'_> {
    fn done(&self) -> f64 {
        *self
            .fraction
            .lock()
            .unwrap_or_else(|held| held.into_inner())
    }
}

impl Monitor for Until<'_> {
    fn progress(&self, fraction: f64) {
        let mut most = self
            .fraction
            .lock()
            .unwrap_or_else(|held| held.into_inner());
        *most = most.max(fraction);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled() || Instant::now() > self.deadline
    }
}
