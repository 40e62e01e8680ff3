//! The accuracy contract: what every former says of its image's error, and that a bound asked for is
//! kept or its miss is told.
//!
//! **The error** is relative and RMS over all pixels of the grid, `sqrt(sum |I - E|^2 / sum |E|^2)`, in
//! dB: `I` the image, `E` the sum of [`super`] over the stored samples, evaluated exactly. It is relative to
//! what the grid shows: of a grid that leaves the bright scatterers out, the image is weak, and the
//! same errors are relatively larger.
//!
//! **What a former plans.** A former multiplies each of the sum's terms by `1 + d` (`d` complex, of pixel,
//! pulse and frequency). Before anything heavy it bounds the RMS of `d` for its track, band and
//! grid: the *planned* error. If that misses the bound asked, it refuses ([`Asked::check`]). Where terms add
//! in phase, as on a scatterer, the image's error is at most that of the value itself (Cauchy and Schwarz); where they
//! add at random, as in noise and clutter, powers add and it is that again.
//!
//! Where antennas move from sample to sample of a pulse and the former takes all samples at one place, what that leaves
//! ([`super::sweep::residual`]) is added for it.
//!
//! **What becomes of the image.** Neither holds where terms cancel: beside a bright scatterer that the grid leaves out, errors
//! cancel less than its side lobes do. No plan knows the scene, so every image is looked at: as the pulses are
//! read, the exact sum at 64 of its pixels is kept besides ([`Exact`](super::exact::Exact)'s; a small part of the
//! work), and with `s^2` the mean square error there and `M` the image's mean square
//!
//! ```text
//! predicted^2 = max(planned^2, C s^2 / M + e^2 T / M)
//! ```
//!
//! with `T` the terms' powers and `e` the rounding of the sum's own phases.
//! `C` is what a mean of so few squares scatters by: 1 where all pixels are sampled (128 or fewer), 1.6 where the image is as a plan
//! takes it, 2 where it errs by more than that, and 10 where errors may sit in few pixels: where `s^2 / M` is 6 dB above the
//! plan's, or the grid is dark, `M` less than 0.3 of `T`, which is what noise would show. Where a bound is missed in this
//! way, the image is formed once more with a plan for that much less ([`ImageFormer::planning_for`]; `planned_for_db` in
//! the settings), twice the work and more; one that is missed then is an error too, after the work.
//! A grid that is coarser than the resolution may show a lone scatterer by its side lobes only, which are what the ends of the band and
//! of the aperture make; errors that are larger there are larger in it, with the range-Doppler algorithm by up to 14 dB.
//! A prediction of -3 dB or more says that the image is worth nothing, not how far it errs.
//!
//! Accuracy: `tests/formers/random.rs` measures every former against the sum over thousands of random
//! geometries, scenes and grids.

use num_complex::Complex64;

use super::budget::Budget;
use super::sampled::{Probes, Sampled, TileRecord};
use super::{
    Aim, Decision, FormError, Formed, ImageFormer, Reason, Remedy, Task, Tile, Work, rounding,
    sweep,
};
use subaperture_kernels::horner;
use subaperture_model::phase_history::PhaseHistory;

/// `C` of the module's formula where there are more pixels, where they err by more than planned, and where
/// errors may sit in few of them.
const SCATTER: f64 = 1.6;
const LARGER_SCATTER: f64 = 2.0;
const UNEVEN_SCATTER: f64 = 10.0;

/// Error over the planned, in power, above which it is uneven.
const UNEVEN: f64 = 4.0;

/// Mean square over the terms' powers below which a grid is dark.
const DARK: f64 = 0.3;

/// Error, relative to the image's mean square, above which that tells of the error more than of the scene.
const SPOILT: f64 = 0.01;

/// Least error that a sample shows: the image's own rounding to float32.
const LEAST_DB: f64 = -200.0;

/// Whether an image may be worse than asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misses {
    /// A missed bound is [`FormError::BoundMissed`].
    Refused,
    /// A missed bound is recorded.
    Allowed,
}

/// What is asked of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Bound on the error, dB, if there is one.
    pub bound_db: Option<f64>,
    /// Whether it may be missed.
    pub misses: Misses,
}

impl Asked {
    /// Goes on if an image predicted to err by `predicted_db` will do. `limit` says what limits it and what
    /// would help.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`] if it will not.
    pub fn check(
        &self,
        predicted_db: f64,
        limit: impl FnOnce() -> Reason,
    ) -> Result<(), FormError> {
        match self.bound_db {
            Some(bound_db)
                if self.misses == Misses::Refused && misses(predicted_db, Some(bound_db)) =>
            {
                Err(FormError::BoundMissed {
                    predicted_db,
                    bound_db,
                    limit: limit(),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Whether a prediction misses a bound; one that is no number does.
pub(super) fn misses(predicted_db: f64, bound_db: Option<f64>) -> bool {
    bound_db.is_some_and(|bound_db| predicted_db.is_nan() || predicted_db > bound_db)
}

/// Forms the image of `task` as `former` decides, by `form`, under the contract.
///
/// # Errors
/// Those of the former and `form`; [`FormError::NotFinite`]; [`FormError::BoundMissed`].
pub(super) fn keep<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<Formed, FormError> {
    let asked = former.asked(misses);
    attempt(former, task, &asked, form)?.judge(&asked)
}

/// The image of `task`; where the plan was kept and the scene makes more of it than was asked, once more with a plan for so much
/// less ([`ImageFormer::planning_for`]).
///
/// # Errors
/// As [`keep`].
pub(super) fn keep_replanning<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
) -> Result<Formed, FormError> {
    let asked = former.asked(misses);
    let first = attempt(former, task, &asked, opened(former, task))?;
    let next = first.judgement.next_plan_db(&asked);
    let Some((next_db, stricter)) = next.and_then(|db| Some((db, former.planning_for(db)?))) else {
        return first.judge(&asked);
    };
    let missed = first.judge(&asked).map(drop);
    let second = attempt(
        &*stricter,
        task,
        &stricter.asked(misses),
        opened(&*stricter, task),
    );
    match (second, missed) {
        // No such plan: what the first one's miss says is what can be done.
        (Err(FormError::BoundMissed { .. }), Err(missed)) => Err(missed),
        (Err(error), _) => Err(error),
        (Ok(mut second), _) => {
            let settings = &mut second.formed.settings;
            settings.insert("planned_for_db".to_owned(), next_db.into());
            second.judge(&asked)
        }
    }
}

/// What opens a decision and forms by it.
fn opened<'a, F: ImageFormer + ?Sized>(
    former: &'a F,
    task: &'a Task,
) -> impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError> + 'a {
    |decision, work, tiles| {
        former
            .open(task.aim(), &decision.choices)?
            .form(work, tiles)
    }
}

/// What is known of an image's error, dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// As it was planned.
    pub planned_db: f64,
    /// As it shows at the sampled pixels; infinite of an image for which not all pulses were read.
    pub measured_db: f64,
    /// These pixels.
    pub num_sampled: usize,
}

impl Judgement {
    /// The error to expect: the larger of both.
    pub fn predicted_db(&self) -> f64 {
        self.planned_db.max(self.measured_db)
    }

    /// What to plan for so that `bound_db` is kept, the scene making as much of that plan as of this one.
    pub fn plan_for_db(&self, bound_db: f64) -> f64 {
        bound_db + self.planned_db - self.measured_db - 1.0
    }

    /// That, if what was asked is missed, and not by the plan itself.
    pub fn next_plan_db(&self, asked: &Asked) -> Option<f64> {
        let bound_db = asked.bound_db?;
        let is_of_scene = self.planned_db <= bound_db && self.measured_db > bound_db;
        let next_db = self.plan_for_db(bound_db);
        (is_of_scene && next_db.is_finite()).then_some(next_db)
    }

    /// Goes on if the image is what was asked for, or misses are allowed.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`].
    pub fn check(&self, asked: &Asked) -> Result<(), FormError> {
        asked.check(self.predicted_db(), || {
            let error_db = self.plan_for_db(asked.bound_db.unwrap_or(0.0));
            let why = format!(
                "the former plans {:.1} dB, and its error at {} pixels is more: the grid is dark, beside \
                 something bright that it leaves out",
                self.planned_db, self.num_sampled,
            );
            Reason::new(why).helped_by(&[Remedy::GridWith, Remedy::PlanFor { error_db }])
        })
    }

    /// Notes it among the settings of an image, with the bound asked. Whether that is missed.
    pub fn note(&self, bound_db: Option<f64>, settings: &mut Settings) -> bool {
        settings.insert("planned_error_db".to_owned(), self.planned_db.into());
        note_error(bound_db, self.predicted_db(), settings)
    }
}

/// What an image was formed with, as its record has it.
pub type Settings = serde_json::Map<String, serde_json::Value>;

/// Notes the error to expect, and the bound it is to keep, among settings. Whether that is missed.
pub(super) fn note_error(
    bound_db: Option<f64>,
    predicted_db: f64,
    settings: &mut Settings,
) -> bool {
    let missed = misses(predicted_db, bound_db);
    settings.insert("predicted_error_db".to_owned(), predicted_db.into());
    if let Some(bound_db) = bound_db {
        settings.insert("error_db".to_owned(), bound_db.into());
        settings.insert("bound_missed".to_owned(), missed.into());
    }
    missed
}

/// An image, and what is known of its error.
struct Attempt {
    formed: Formed,
    judgement: Judgement,
}

impl Attempt {
    /// The image with its prediction, if it is what was asked for or misses are allowed.
    fn judge(mut self, asked: &Asked) -> Result<Formed, FormError> {
        let Self { formed, judgement } = &mut self;
        formed.predicted_error_db = judgement.predicted_db();
        formed.bound_missed = judgement.note(asked.bound_db, &mut formed.settings);
        judgement.check(asked)?;
        Ok(self.formed)
    }
}

fn attempt<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    asked: &Asked,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<Attempt, FormError> {
    task.check()?;
    super::check_surface(former, task.grid)?;
    let aim = task.aim();
    let swept = swept(former, &aim, asked)?;
    let probes = Probes::new(aim, asked.bound_db.unwrap_or(f64::NEG_INFINITY));
    let sampled = Sampled {
        history: task.history,
        probes: &probes,
        monitor: task.monitor,
    };
    let (tile, decision) = whole(former, task, asked, &sampled, form)?;
    let planned_db = with_sweep(decision.planned_db, swept);
    let judgement = match probes.record(&tile) {
        Some(record) => judge(&aim, &[record], planned_db),
        // A former that left pulses out has no image of them all.
        None => Judgement {
            planned_db,
            measured_db: f64::INFINITY,
            num_sampled: 0,
        },
    };
    let mut formed = Formed::on(task.grid, tile.pixels, planned_db, decision.settings);
    task.means.note(&mut formed.settings);
    Ok(Attempt { formed, judgement })
}

/// What taking all samples of a pulse at one place leaves, if `former` does, relative.
///
/// # Errors
/// [`FormError::BoundMissed`] if that alone is too much.
pub(super) fn swept<F: ImageFormer + ?Sized>(
    former: &F,
    aim: &Aim,
    asked: &Asked,
) -> Result<f64, FormError> {
    if former.follows_sweeps() {
        return Ok(0.0);
    }
    let swept = sweep::residual(aim.collection, aim.grid);
    asked.check(20.0 * libm::log10(swept), || {
        Reason::new(
            "the antennas move from sample to sample of a pulse, and this former takes all samples of one at one place",
        )
        .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"])])
    })?;
    Ok(swept)
}

/// A planned error with what taking all samples of a pulse at one place leaves.
pub(super) fn with_sweep(planned_db: f64, swept: f64) -> f64 {
    match swept > 0.0 {
        true => rounding::total_db(&[libm::pow(10.0, planned_db / 20.0), swept]),
        false => planned_db,
    }
}

/// The whole image of `task` in memory, its pulses read from `history`.
fn whole<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    asked: &Asked,
    history: &dyn PhaseHistory,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<(Tile, Decision), FormError> {
    // Before pixels are looked at: there may be far too many.
    let budget = Budget::for_task(task, 8)?;
    let decision = former.decide(&task.aim(), asked, task.monitor)?;
    let work = Work {
        history,
        memory_bytes: budget.left_bytes(),
        monitor: task.monitor,
    };
    let mut tile = Tile::whole(task.grid);
    form(&decision, &work, std::slice::from_mut(&mut tile))?;
    tile.check_finite(task.grid)?;
    Ok((tile, decision))
}

/// [`keep`] of an image whose pixels are no places at rest, so that there is no sum to compare them with: by the plan alone.
pub(super) fn keep_planned<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
) -> Result<Formed, FormError> {
    task.check()?;
    super::check_surface(former, task.grid)?;
    let asked = former.asked(misses);
    let (tile, decision) = whole(former, task, &asked, task.history, opened(former, task))?;
    let planned_db = decision.planned_db;
    let mut formed = Formed::on(task.grid, tile.pixels, planned_db, decision.settings);
    formed.expect(asked.bound_db, planned_db);
    task.means.note(&mut formed.settings);
    Ok(formed)
}

/// What the records of all tiles tell of an image that was planned to err by `planned_db`: `C s^2 / M` of the module's
/// formula.
pub(super) fn judge(aim: &Aim, records: &[TileRecord], planned_db: f64) -> Judgement {
    let total = aim.grid.num_pixels() as usize;
    let (mut error, mut exact, mut count) = (0.0, 0.0, 0usize);
    for seen in records.iter().flat_map(|record| &record.seen) {
        let formed = Complex64::new(seen.formed[0].into(), seen.formed[1].into());
        let expected = Complex64::new(seen.exact[0], seen.exact[1]);
        error += (formed - expected).norm_sqr();
        exact += expected.norm_sqr();
        count += 1;
    }
    let mean = records.iter().map(|record| record.power).sum::<f64>() / total as f64;
    let terms = records.iter().fold(0.0f64, |most, r| most.max(r.terms));
    let shown = error / count as f64 / mean;
    let relative = if count == total {
        error / exact
    } else if shown > SPOILT {
        UNEVEN_SCATTER * error / exact
    } else {
        let dark = mean < DARK * terms;
        let above = shown / libm::pow(10.0, planned_db / 10.0);
        shown
            * match () {
                () if dark || above > UNEVEN => UNEVEN_SCATTER,
                () if above > 1.0 => LARGER_SCATTER,
                () => SCATTER,
            }
    };
    // The sum's phases are rounded too. Terms do not share that, so that it is small relative to their powers, not to
    // what is left of them.
    let narrow = match records.iter().any(|record| record.narrow) {
        true => horner::NARROW_RMS,
        false => 0.0,
    };
    let own = libm::hypot(rounding::path_phase_rad(aim.collection, aim.grid), narrow).powi(2)
        * terms
        / mean;
    // Of an image of zeros where there should be zeros, nothing is wrong.
    let measured_db = match error == 0.0 && !own.is_finite() {
        true => LEAST_DB,
        false => 10.0 * libm::log10(relative + own),
    };
    Judgement {
        planned_db,
        measured_db,
        num_sampled: count,
    }
}
