//! The accuracy contract: the error that every former predicts for its image, and the bound that it keeps or reports as exceeded.
//!
//! **Error.** Relative and RMS over all pixels of the grid, `sqrt(sum |I - E|^2 / sum |E|^2)`, in dB: `I` is the image, `E` the exact sum of
//! [`super`] over the stored samples. On a grid without the bright scatterers of the scene the image is weak, and the same errors are
//! relatively larger.
//!
//! **Planned error.** A former multiplies each of the sum's terms by `1 + d` (`d` complex, a function of pixel, pulse and frequency). Before it
//! reads samples it bounds the RMS of `d` for its track, band and grid. If that exceeds the requested bound, it refuses ([`ErrorGoal::check`]).
//! Where terms add in phase, as on a scatterer, the image's error is at most the value's own (Cauchy and Schwarz). Where they
//! add at random, as in noise and clutter, powers add, with the same result. Where antennas move from sample to sample of a pulse and the former takes all
//! samples at one place, the error of that ([`super::sweep::residual`]) is added.
//!
//! **Predicted error.** The planned error does not hold where terms cancel: next to a bright scatterer outside the grid errors cancel less than
//! the scatterer's side lobes do. So every image is compared with the exact sum ([`Exact`](super::exact::Exact)'s) at 64 pixels spread
//! evenly, as the pulses are read, and at 64 more drawn by the image's own power, in a second pass over the pulses
//! (`second_look.rs`); 256 where the estimate from 64 keeps the bound but its upper limit does not. With `E` the upper limit of the estimated sum of squared errors, `M` the image's mean square over its `N` pixels,
//!
//! ```text
//! predicted^2 = max(planned^2, E / (N M) + e^2 T / M + s^2 S / (N M))
//! ```
//!
//! `T` is the power of the terms and `e` the rounding of the sum's own phases. The last term is an upper bound on the echoes of scatterers outside
//! the grid, which both kinds of pixels can miss: `s` is the part of the planned error that makes such echoes, `S` the most energy
//! outside the grid that the recorded samples allow (`stray.rs`). The settings record `sampled_error_db` (the first two terms) and
//! `outside_error_db` (the last one).
//!
//! *All pixels.* Of an image of 128 or fewer pixels all are compared, and `E` is the sum itself. So it is where a small image would
//! exceed the bound by the formula: then the sum decides.
//!
//! *Pixels spread evenly alone.* The second pass is left out where the first settles that the bound is kept: the grid is bright, and the planned error, times `1 + T / M` in power
//! where the compared pixels are weaker than the image, keeps the bound and is not exceeded at these pixels. Pulses of a
//! live image cannot be read again. Then `E` is the estimate from the pixels spread evenly times `C`: 1.6 where they err as planned, 2
//! where they err by more, and 10 where errors may sit in few pixels: where they err by 6 dB more than planned, the grid is dark (`M`
//! less than 0.3 of `T`, the power that noise would show), or their mean square is less than half of `M`. In the last case `C` is 1.6 if the grid is bright and the
//! error is as expected; the planned error power of the pixels that were not compared is added.
//!
//! *Planned again.* Where the plan keeps the bound and the image exceeds it, the image is formed again with a stricter plan
//! ([`ImageFormer::planning_for`]; `planned_for_db` in the settings), at most three times, each at more than twice the work. Where the bound may be
//! exceeded, a plan of more than 32 times the operations is not carried out. If the last image exceeds a bound that must be kept, it is an error.
//! [`passing_bound_db`] is the bound that would be kept.
//!
//! A grid coarser than the resolution may show a lone scatterer by its side lobes only. These come from the ends of the band and
//! of the aperture; errors that are larger there are larger in the image, with the range-Doppler algorithm by up to 14 dB. A prediction of
//! -3 dB or more means that the image is worthless; it does not measure the error.
//!
//! Accuracy: `tests/formers/random.rs` measures every former against the sum over thousands of random
//! geometries, scenes and grids, dark, tiny and off-centre ones among them.

use num_complex::Complex64;

use super::budget::Budget;
use super::compared::{self, Compared, Planned};
use super::cost::StageCost;
use super::coverage::{self, Coverage};
use super::drawn::MOST_DRAWS;
use super::goal::{BoundPolicy, ErrorGoal, Settings, misses, note_error};
use super::sampled::{Probes, TileRecord};
use super::second_look::{DRAWS, Estimate, add_all, look_again, look_at_all};
use super::{
    Decision, FormError, Formed, ImageFormer, ImageSpec, Reason, Remedy, Task, Tile, Work, dark,
    rounding, second_look, sweep,
};
use subaperture_model::image::ImageSource;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;

/// Smallest reduction of the planned error, dB, for which a stricter plan is used.
const MIN_GAIN_DB: f64 = 0.5;

/// Largest factor in operations of a stricter plan where the bound may be exceeded.
const MAX_TIMES: f64 = 32.0;

/// Whether to form an image again, from the (planned error in dB, operations) of the first and the second plan.
pub(super) fn is_worth_forming_again(
    [first, second]: [(f64, f64); 2],
    bound_policy: BoundPolicy,
) -> bool {
    let takes_not_too_long =
        bound_policy == BoundPolicy::Refused || second.1 <= MAX_TIMES * first.1;
    second.0 <= first.0 - MIN_GAIN_DB && takes_not_too_long
}

/// Increment of a raised bound, dB, and largest number of increments.
const BOUND_STEP_DB: f64 = 0.1;
const BOUND_TRIES: usize = 12;

/// Smallest bound, in tenths of a dB, that `former` plans to keep for `spec` where its image is predicted to err by `predicted_db`.
/// An image with this bound passes. `None` if no bound below 0 dB passes.
///
/// A plan for a larger bound is cheaper and errs by more, so the prediction may exceed its own value as a bound. Each candidate is therefore planned.
///
/// # Errors
/// [`FormError::Cancelled`], and errors of the former except an exceeded bound.
pub fn passing_bound_db(
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    predicted_db: f64,
    monitor: &dyn Monitor,
) -> Result<Option<f64>, FormError> {
    let up = |db: f64| (db * 10.0 - 1e-6).ceil() / 10.0;
    let mut bound_db = up(predicted_db);
    for tried in 0..BOUND_TRIES {
        if bound_db.is_nan() || bound_db >= 0.0 {
            return Ok(None);
        }
        let Some(asking) = former.planning_for(bound_db) else {
            return Ok(Some(bound_db));
        };
        let goal = asking.goal(BoundPolicy::Refused);
        let swept = match swept(&*asking, spec, &goal) {
            Err(FormError::BoundMissed { predicted_db, .. }) => {
                bound_db = up(predicted_db).max(bound_db + BOUND_STEP_DB);
                continue;
            }
            swept => swept?,
        };
        let planned_db = match asking.decide(spec, &goal, monitor) {
            Ok(decision) => with_sweep(decision.planned_db, swept),
            Err(FormError::BoundMissed { predicted_db, .. }) => predicted_db,
            Err(error) => return Err(error),
        };
        if !misses(planned_db, Some(bound_db)) {
            return Ok(Some(bound_db));
        }
        // A plan may err by more when the bound is larger; growing steps catch up with it.
        bound_db = up(planned_db).max(bound_db + BOUND_STEP_DB * (1 << tried.min(6)) as f64);
    }
    Ok(None)
}

/// Planned and measured error of an image, dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Planned error, dB.
    pub planned_db: f64,
    /// Error estimated at the compared pixels, dB; infinite if not all pulses were read.
    pub measured_db: f64,
    /// Upper bound on the contribution of scatterers outside the grid, dB; minus infinity for no contribution.
    pub outside_db: f64,
    /// Number of compared pixels.
    pub num_sampled: usize,
    /// Larger spacing of the pixels along rows and columns, resolution cells.
    pub spacing_cells: f64,
}

impl Judgement {
    /// Predicted error, dB: the larger of the planned error and the sum of measured error and contribution from outside the grid.
    pub fn predicted_db(&self) -> f64 {
        self.planned_db.max(self.shown_db())
    }

    /// Sum of measured error and contribution from outside the grid, dB.
    fn shown_db(&self) -> f64 {
        let power = |db: f64| libm::pow(10.0, db / 10.0);
        match self.outside_db == f64::NEG_INFINITY {
            true => self.measured_db,
            false => 10.0 * libm::log10(power(self.measured_db) + power(self.outside_db)),
        }
    }

    /// Planned error, dB, that would keep `bound_db` if the scene enlarges it by the same factor as this one.
    pub fn plan_for_db(&self, bound_db: f64) -> f64 {
        bound_db + self.planned_db - self.shown_db() - 1.0
    }

    /// Planned error for another attempt, dB. `None` if the requirement is met or if the plan alone exceeds the bound.
    pub fn next_plan_db(&self, goal: &ErrorGoal) -> Option<f64> {
        let bound_db = goal.bound_db?;
        let is_of_scene = self.planned_db <= bound_db && self.shown_db() > bound_db;
        let next_db = self.plan_for_db(bound_db);
        (is_of_scene && next_db.is_finite()).then_some(next_db)
    }

    /// Accept the image if it keeps the bound, or if the bound may be exceeded.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`], which advises a stricter plan.
    pub fn check(&self, goal: &ErrorGoal) -> Result<(), FormError> {
        let error_db = self.plan_for_db(goal.bound_db.unwrap_or(0.0));
        self.check_advised(goal, &[Remedy::PlanFor { error_db }])
    }

    /// Accept the image as [`Self::check`] does, after all stricter plans that are available.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`], which advises none.
    pub(super) fn check_replanned(&self, goal: &ErrorGoal) -> Result<(), FormError> {
        self.check_advised(goal, &[])
    }

    fn check_advised(&self, goal: &ErrorGoal, more: &[Remedy]) -> Result<(), FormError> {
        goal.check(self.predicted_db(), || {
            let scene = dark::reason_at(self.spacing_cells);
            let why = format!(
                "the planned error is {:.1} dB, and the error at {} compared pixels is larger: {scene}",
                self.planned_db, self.num_sampled,
            );
            Reason::new(why)
                .helped_by(&scene.remedies)
                .helped_by(more)
        })
    }

    /// Record the error and the bound in the settings of an image. Return whether the bound is exceeded.
    pub fn note(&self, bound_db: Option<f64>, settings: &mut Settings) -> bool {
        let mut record = |key: &str, db: f64| settings.insert(key.to_owned(), db.into());
        record("planned_error_db", self.planned_db);
        record("sampled_error_db", self.measured_db);
        if self.outside_db.is_finite() {
            record("outside_error_db", self.outside_db);
        }
        note_error(bound_db, self.predicted_db(), settings)
    }
}

/// Relative error of the stop-and-go approximation within a pulse, if `former` makes it.
///
/// # Errors
/// [`FormError::BoundMissed`] if this error alone exceeds the bound.
pub(super) fn swept<F: ImageFormer + ?Sized>(
    former: &F,
    spec: &ImageSpec,
    goal: &ErrorGoal,
) -> Result<f64, FormError> {
    if former.follows_sweeps() {
        return Ok(0.0);
    }
    let swept = sweep::residual(spec.collection, spec.grid);
    goal.check(20.0 * libm::log10(swept), || {
        Reason::new(
            "the antennas move during a pulse, and this former assumes one position for all its samples (stop-and-go)",
        )
        .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"])])
    })?;
    Ok(swept)
}

/// Planned error including the stop-and-go approximation within a pulse, dB.
pub(super) fn with_sweep(planned_db: f64, swept: f64) -> f64 {
    match swept > 0.0 {
        true => rounding::total_db(&[libm::pow(10.0, planned_db / 20.0), swept]),
        false => planned_db,
    }
}

/// Form the image of `task` by `form` with the choices of `former`, without a comparison with the exact sum: only the plan is checked. Pixels
/// outside the recorded delays are zero.
///
/// # Errors
/// Errors of the former and of `form`; [`FormError::NotFinite`]; [`FormError::BoundMissed`].
pub(super) fn keep_planned<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    bound_policy: BoundPolicy,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<Formed, FormError> {
    super::check(task.history.collection(), task.grid)?;
    super::check_surface(former, task.grid)?;
    let goal = former.goal(bound_policy);
    // Check the memory before listing pixels; the grid may be far too large.
    let budget = Budget::for_task(task, 8)?;
    let decision = former.decide(&task.spec(), &goal, task.monitor)?;
    let work = Work {
        memory_bytes: budget.left_bytes(),
        ..task.work()
    };
    let mut tile = Tile::whole(task.grid);
    form(&decision, &work, std::slice::from_mut(&mut tile))?;
    let num_uncovered = Coverage::new(task.spec(), former.grid_points()).clear(&mut tile);
    tile.check_finite(task.grid)?;
    let planned_db = decision.planned_db;
    let mut formed = Formed::on(task.grid, tile.pixels, planned_db, decision.settings);
    coverage::note(num_uncovered, &mut formed.settings);
    formed.expect(goal.bound_db, planned_db);
    task.numerics.note(&mut formed.settings);
    Ok(formed)
}

/// Cost of comparing an image of `spec` with the exact sum, in both passes over its pulses. No plan's cost contains it.
pub fn comparison_cost(spec: &ImageSpec) -> StageCost {
    second_look::cost(spec)
}

/// Error of an image from the records of all tiles and, where needed, from a second pass at pixels with the image's power. The second pass is
/// skipped if the first settles that the bound is kept: the grid is bright, the compared pixels err no more than expected ([`Compared::expected`]), and the
/// expected error plus the contribution of scatterers outside the grid keeps the bound. Their whole planned error counts there, and must not exceed the prediction:
/// in addition to echoes it contains errors close to the scatterer, such as those of the wavefront curvature of [`super::pfa`] at the edge of a grid that a main lobe
/// overlaps. A second pass reads all pulses of `history` again, and so does a third with more pixels. Every pixel of `image` is compared where it is small and would exceed the bound otherwise.
///
/// # Errors
/// [`FormError::Read`]; [`FormError::Cancelled`]; [`FormError::Sink`] if the image cannot be read.
pub(super) fn judge_again(
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    records: &[TileRecord],
    image: Option<&dyn ImageSource>,
    planned: Planned,
    goal: &ErrorGoal,
    monitor: &dyn Monitor,
) -> Result<Judgement, FormError> {
    let judgement = judge(spec, records, planned, None);
    let compared = Compared::of(spec, records);
    let power = |db: f64| libm::pow(10.0, db / 10.0);
    // The same bound with the whole planned error in place of the part that makes echoes.
    let outside_db = judgement.outside_db + (planned.planned_db - planned.stray_db);
    let expected = compared.expected(planned.planned_db);
    let expected = expected.filter(|&expected| compared.shown() <= expected);
    let keeps = |(bound_db, expected): (f64, f64)| {
        expected + power(outside_db) <= power(bound_db) && judgement.predicted_db() <= bound_db
    };
    let is_predicted = outside_db <= planned.planned_db.max(judgement.outside_db);
    let settled = is_predicted && goal.bound_db.zip(expected).is_some_and(keeps);
    if settled || compared.count == compared.total {
        return Ok(judgement);
    }
    let again = look_again(spec, history, records, DRAWS, monitor)?;
    let mut judgement = judge(spec, records, planned, again);
    let keeps_itself = |estimate: &Estimate, bound_db: f64| {
        estimate.error <= power(bound_db) * records.iter().map(|r| r.power).sum::<f64>()
    };
    // An estimate that keeps the bound without its upper limit is repeated with more pixels, which takes less time than another image.
    if judgement.next_plan_db(goal).is_some()
        && again
            .as_ref()
            .zip(goal.bound_db)
            .is_some_and(|(estimate, bound_db)| keeps_itself(estimate, bound_db))
    {
        let more = look_again(spec, history, records, MOST_DRAWS, monitor)?;
        judgement = judge(spec, records, planned, more);
    }
    // A small image is refused for actual errors only, not for possible ones.
    let image = image.filter(|_| judgement.next_plan_db(goal).is_some());
    match image {
        Some(image) => {
            let all = look_at_all(spec, history, image, monitor)?;
            Ok(all.map_or(judgement, |all| judge(spec, &[all], planned, None)))
        }
        None => Ok(judgement),
    }
}

/// Error of an image with planned error `planned`, from the records of all tiles and an optional second pass, by
/// the formula of this module.
pub(super) fn judge(
    spec: &ImageSpec,
    records: &[TileRecord],
    planned: Planned,
    again: Option<Estimate>,
) -> Judgement {
    let measured = compared::measure(spec, records, planned, again);
    Judgement {
        planned_db: planned.planned_db,
        measured_db: measured.measured_db,
        outside_db: measured.outside_db,
        num_sampled: measured.count,
        spacing_cells: dark::spacing_cells(spec),
    }
}

/// Share of the energy of strong scatterers at the ranges of a grid from which the grid is taken to hold the scene.
const MOSTLY_ON_GRID: f64 = 0.9;

/// Planned error, dB, that leaves room for echoes of scatterers outside the grid within the bound, from the energy of
/// `history` and the exact sum at the compared pixels. `None` where the plan leaves enough room already.
///
/// Where most of the energy of strong scatterers lies at the ranges of the grid, they are taken to lie on it. The image energy is estimated from the
/// compared pixels; it is known exactly once the image is formed ([`judge`]).
///
/// # Errors
/// [`FormError::Read`]; [`FormError::Cancelled`].
pub(super) fn room_for_outside(
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    planned: Planned,
    goal: &ErrorGoal,
    monitor: &dyn Monitor,
) -> Result<Option<f64>, FormError> {
    let probes = Probes::new(*spec, goal.bound_db.unwrap_or(f64::NEG_INFINITY));
    add_all(&probes, spec, history, monitor)?;
    let (Some(values), Some(recorded)) = (probes.values(), probes.recorded()) else {
        return Ok(None);
    };
    let total = spec.grid.num_pixels() as usize;
    let [all, swath] = recorded;
    if values.len() == total || swath.strong >= MOSTLY_ON_GRID * all.strong {
        return Ok(None);
    }
    let mean = values.iter().map(Complex64::norm_sqr).sum::<f64>() / values.len() as f64;
    let outside = planned.outside(spec, recorded, total as f64 * mean);
    let judgement = Judgement {
        planned_db: planned.planned_db,
        measured_db: planned.planned_db,
        outside_db: 10.0 * libm::log10(outside),
        num_sampled: values.len(),
        spacing_cells: dark::spacing_cells(spec),
    };
    Ok(judgement.next_plan_db(goal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costly_plans_replace_others_only_where_the_bound_must_be_kept() {
        let (first, costly) = ((-64.0, 1.0), (-76.0, 100.0));
        let replaces = |second, policy| is_worth_forming_again([first, second], policy);
        assert!(replaces(costly, BoundPolicy::Refused));
        assert!(!replaces(costly, BoundPolicy::Allowed));
        assert!(replaces((-76.0, 30.0), BoundPolicy::Allowed));
        assert!(!replaces((-64.2, 1.0), BoundPolicy::Refused));
    }
}
