//! Search over a recording's geometry on pixels that follow the displaced scene.

use std::time::{Duration, Instant};

use glam::DVec3;

use super::anchor::shift_m;
use super::measure::{Sight, merit, merits};
use crate::search::{Axis, Order, Search, Tuned, expected, search, search_from};
use crate::trials::{TuneError, Verdict};
use subaperture_focus::bp::Backprojection;
use subaperture_focus::{FormError, ImageFormer, Task};
use subaperture_io::recording::Take;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;

/// Recording whose geometry depends on parameters.
pub trait Model {
    /// Recording for these values of the parameters, with the given pulses ([`Take::pulses`]), or with those that the model
    /// selects for these values.
    ///
    /// # Errors
    /// [`FormError`].
    fn take(&self, values: &[f64], pulses: Option<&[usize]>) -> Result<Take, FormError>;
}

/// Search problem: recording, intervals, figure of merit and limits.
pub struct Problem<'a> {
    /// Recording to be calibrated.
    pub model: &'a dyn Model,
    /// Search intervals of the parameters.
    pub intervals: &'a [Axis],
    /// Order and refinement of the search.
    pub search: Search,
    /// Grid or points for the merit.
    pub sight: &'a Sight,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// Memory limit of images and samples, bytes.
    pub memory_bytes: u64,
    /// Receives progress and can cancel.
    pub monitor: &'a dyn Monitor,
}

/// Largest number of searches with the same pulses.
const ROUNDS: usize = 4;

/// Error bound of the image for the search of the brightest point, dB.
const ERROR_DB: f64 = -30.0;

/// Find the parameter values with the largest merit, with their errors.
///
/// For points of known position one search suffices. For the sharpness of an image, the search on the given pixels gives an
/// initial estimate. Further searches use the pulses selected there, with pixels that follow the brightest point
/// (`anchor.rs`), until the result no longer changes.
///
/// # Errors
/// [`TuneError`].
///
/// # Panics
/// As [`search`].
pub fn determine(problem: &Problem) -> Result<Tuned, TuneError<FormError>> {
    let &Problem {
        model,
        intervals,
        windows,
        memory_bytes,
        monitor,
        ..
    } = problem;
    let Sight::Grid(given, measure) = problem.sight else {
        return search(intervals, problem.search, monitor, |values| {
            let take = model.take(values, None)?;
            merits(&take.history, problem.sight, windows, memory_bytes, monitor)
        });
    };
    let portion = |number: usize| Portion {
        monitor,
        from: number as f64 / (ROUNDS + 1) as f64,
        length: 1.0 / (ROUNDS + 1) as f64,
    };
    let first = search(intervals, problem.search, &portion(0), |values| {
        let take = model.take(values, None)?;
        merit(&take.history, problem.sight, windows, memory_bytes, monitor)
    })?;
    let mut evaluations = first.evaluations;
    let mut at = first.best;
    let turns = Search {
        order: Order::InTurn,
        ..problem.search
    };
    let mut round = 1;
    loop {
        let anchor = model.take(&at, None).map_err(TuneError::Failed)?;
        let brightest_m = brightest(problem, given, &anchor).map_err(TuneError::Failed)?;
        let place = |take: &Take| (take.history.collection().pulses.clone(), take.bias_path_m);
        let (from, from_bias_m) = place(&anchor);
        let mut tuned = search_from(intervals, turns, Some(&at), &portion(round), |values| {
            let take = model.take(values, Some(&anchor.pulses))?;
            let (to, to_bias_m) = place(&take);
            let moved_m = shift_m(given, brightest_m, (&from, from_bias_m), (&to, to_bias_m));
            let grid = ImageGrid {
                origin_m: given.origin_m + moved_m,
                ..given.clone()
            };
            merits(
                &take.history,
                &Sight::Grid(grid, *measure),
                windows,
                memory_bytes,
                monitor,
            )
        })?;
        evaluations += tuned.evaluations;
        let finest =
            |axis: &Axis| axis.step / f64::from(1u32 << problem.search.refinements.min(30));
        let stays = tuned
            .scans
            .iter()
            .zip(intervals)
            .zip(tuned.best.iter().zip(&at))
            .all(|((scan, axis), (best, at))| {
                let error = scan.error.unwrap_or(0.0);
                (best - at).abs() <= (0.5 * error).max(2.0 * finest(axis))
            });
        if stays || round == ROUNDS {
            if !stays {
                // The optimum depends on the starting point: it is not determined.
                for scan in &mut tuned.scans {
                    scan.verdict = Verdict::Open;
                }
            }
            tuned.grid = first.grid;
            tuned.evaluations = evaluations;
            monitor.progress(1.0);
            return Ok(tuned);
        }
        at = tuned.best;
        round += 1;
    }
}

/// Expected cost of [`determine`].
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Number of images formed.
    pub images: usize,
    /// Time of one image.
    pub each: Duration,
    /// Memory of the recording, bytes.
    pub held_bytes: u64,
}

/// Time one image at the centres of the intervals, and extrapolate to the search, with two more rounds where pixels follow
/// the scene.
///
/// # Errors
/// [`FormError`] of that image.
pub fn rehearse(problem: &Problem) -> Result<Expected, FormError> {
    let &Problem {
        intervals,
        search,
        sight,
        windows,
        memory_bytes,
        monitor,
        ..
    } = problem;
    let start = Instant::now();
    let middles: Vec<f64> = intervals
        .iter()
        .map(|axis| axis.at(axis.count / 2))
        .collect();
    let take = problem.model.take(&middles, None)?;
    merits(&take.history, sight, windows, memory_bytes, monitor)?;
    let turns = Search {
        order: Order::InTurn,
        ..search
    };
    let again = match sight {
        Sight::Grid(..) => 2 * expected(intervals, turns),
        Sight::Points(_) => 0,
    };
    Ok(Expected {
        images: expected(intervals, search) + again,
        each: start.elapsed(),
        held_bytes: take.history.held_bytes(),
    })
}

/// Position of the brightest pixel of a take's image.
fn brightest(problem: &Problem, grid: &ImageGrid, take: &Take) -> Result<DVec3, FormError> {
    let history = &take.history;
    let [fast, slow] = problem.windows;
    let task = Task {
        history,
        grid,
        weights: &Weights::new(history.collection(), fast, slow),
        memory_bytes: problem.memory_bytes,
        monitor: &Portion {
            monitor: problem.monitor,
            from: 0.0,
            length: 0.0,
        },
        numerics: Default::default(),
    };
    let former = Backprojection { error_db: ERROR_DB };
    let peak = former.form_best(&task)?.image.peak();
    Ok(peak.map_or(
        grid.position_m(grid.rows.count / 2, grid.columns.count / 2),
        |peak| grid.position_m(peak.row, peak.column),
    ))
}

/// Progress of a part of the work; a part of zero length reports no progress.
struct Portion<'a> {
    monitor: &'a dyn Monitor,
    from: f64,
    length: f64,
}

impl Monitor for Portion<'_> {
    fn progress(&self, fraction: f64) {
        if self.length > 0.0 {
            self.monitor
                .progress(self.from + self.length * fraction.min(1.0));
        }
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled()
    }
}
