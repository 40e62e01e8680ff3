//! Execution of a plan: form the tiles, compare the image with the exact sum, and plan again where the scene needs it.
//!
//! ```text
//! Plan ── begin (sink: tiles to form) ── form ── records of all tiles ── judge ──> image within the bound
//!   ^                                                                   │
//!   └──── stricter plan, at most three: the scene enlarges the error ───┘
//! ```
//!
//! The loop is the same for an image in memory, in one file, or in a store that several processes fill. These differ only in the
//! [`ImageSink`] that receives the tiles. [`super::accuracy`] defines the error and the stricter plans.

use std::borrow::Cow;

use subaperture_model::image::Image;

use super::budget::Budget;
use super::opened::Opened;
use super::plan::Plan;
use super::sink::{ImageSink, InMemory};
use super::{
    BoundPolicy, FormError, Formed, ImageFormer, ImageSpec, Judgement, Task, Work, check,
    check_surface,
};

/// Largest number of stricter plans, one after the other.
const MAX_REPLANS: u32 = 3;

/// Execution of a plan by a former.
#[derive(Clone, Copy)]
pub struct Execution<'a, F: ?Sized> {
    /// Former that made the plan.
    pub former: &'a F,
    /// Specification of the image that the plan was made for.
    pub spec: ImageSpec<'a>,
    /// Source of the pulses, memory for everything except the sink, and progress.
    pub work: Work<'a>,
    /// Whether stricter plans may replace one whose image exceeds the bound. Not for a plan that other processes carry out as well.
    pub may_replan: bool,
}

/// Complete image with its error.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Executed<'p> {
    /// Plan of the image: the given one, or the stricter one that replaced it.
    pub plan: Cow<'p, Plan>,
    /// Planned and measured error.
    pub judgement: Judgement,
}

impl<F: ImageFormer + ?Sized> Execution<'_, F> {
    /// Form the tiles of `plan` that `sink` needs. If the image is then complete, measure its error, and form it again by a stricter plan where the
    /// scene enlarges the error beyond the bound, at most three times. `None` if tiles of the image are still missing.
    ///
    /// # Errors
    /// [`FormError`]; [`FormError::BoundMissed`] if the image exceeds a bound that must be kept. The sink then holds the complete image.
    pub fn run<'p>(
        &self,
        plan: &'p Plan,
        sink: &mut dyn ImageSink,
    ) -> Result<Option<Executed<'p>>, FormError> {
        let Work {
            history, monitor, ..
        } = self.work;
        let mut plan = Cow::Borrowed(plan);
        let mut num_replans = 0;
        loop {
            let opened = self.open(&plan)?;
            let indices = sink.begin(&plan).map_err(FormError::Sink)?;
            let tiles_a_pass = sink.max_tiles_a_pass(&plan);
            opened.form(&self.work, &indices, tiles_a_pass, sink)?;
            let Some(records) = sink.records().map_err(FormError::Sink)? else {
                return Ok(None);
            };
            let judgement = opened.judge_again(&records, history, sink.image(), monitor)?;
            let next = match self.may_replan && num_replans < MAX_REPLANS {
                true => self.stricter(&plan, &judgement)?,
                false => None,
            };
            match next {
                Some(next) => {
                    drop(opened);
                    plan = Cow::Owned(next);
                    num_replans += 1;
                }
                None => {
                    let goal = plan.goal();
                    match self.may_replan {
                        true => judgement.check_replanned(&goal)?,
                        false => judgement.check(&goal)?,
                    }
                    drop(opened);
                    return Ok(Some(Executed { plan, judgement }));
                }
            }
        }
    }

    fn open<'p>(&'p self, plan: &'p Plan) -> Result<Opened<'p>, FormError> {
        // A stricter plan is opened by the former that made it.
        match plan
            .planned_for_db
            .and_then(|db| self.former.planning_for(db))
        {
            Some(stricter) => Opened::new(&*stricter, plan, self.spec),
            None => Opened::new(self.former, plan, self.spec),
        }
    }

    /// Plan that replaces `plan` where the scene enlarges the error beyond the bound. `None` if the image keeps the bound or no such plan is available.
    fn stricter(&self, plan: &Plan, judgement: &Judgement) -> Result<Option<Plan>, FormError> {
        let Some(error_db) = judgement.next_plan_db(&plan.goal()) else {
            return Ok(None);
        };
        let policy = plan.goal().bound_policy;
        let next = Plan::for_less(self.former, error_db, &self.spec, policy, self.work.monitor);
        match next {
            // A stricter plan is not available.
            Err(FormError::Unsuited(_)) => Ok(None),
            next => Ok(next?
                .filter(|next| plan.is_worth_replacing(next))
                .map(|next| next.with_tiles_as(plan))),
        }
    }
}

/// Form the image of `task` in memory within the error bound of `former`.
///
/// # Errors
/// Errors of [`Plan::new`] and [`Plan::form`].
pub(super) fn in_memory<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    bound_policy: BoundPolicy,
) -> Result<Formed, FormError> {
    // Check the memory before planning; the grid may be far too large.
    check(task.history.collection(), task.grid)?;
    check_surface(former, task.grid)?;
    Budget::for_task(task, 8)?;
    Plan::new(former, &task.spec(), bound_policy, task.monitor)?.form(former, task)
}

impl Plan {
    /// Number of pulses that are read to form the image: `whole` by [`Self::form`], else in passes of as many tiles as memory allows. A pulse that
    /// is read twice counts twice. The comparison of the image with the exact sum reads all pulses once more, unless the first comparison settles
    /// that the bound is kept.
    ///
    /// # Errors
    /// [`FormError::Choices`]; [`FormError::Memory`].
    pub fn pulses_read<F: ImageFormer + ?Sized>(
        &self,
        former: &F,
        task: &Task,
        whole: bool,
    ) -> Result<u64, FormError> {
        let plan = match whole {
            true => Cow::Owned(self.in_one_tile()),
            false => Cow::Borrowed(self),
        };
        let indices: Vec<usize> = (0..plan.num_tiles()).collect();
        let opened = Opened::new(former, &plan, task.spec())?;
        opened.pulses_read(&task.work(), &indices, usize::MAX)
    }

    /// Form the image of the plan in memory. `task` must have the geometry, grid and weights that `former` made the plan for.
    ///
    /// # Errors
    /// [`FormError`]; [`FormError::BoundMissed`] if the image exceeds a bound that must be kept.
    pub fn form<F: ImageFormer + ?Sized>(
        &self,
        former: &F,
        task: &Task,
    ) -> Result<Formed, FormError> {
        Budget::for_task(task, 8)?;
        let plan = self.in_one_tile();
        let execution = Execution {
            former,
            spec: task.spec(),
            work: task.work(),
            may_replan: true,
        };
        let mut sink = InMemory::new();
        let executed = execution.run(&plan, &mut sink)?;
        let Executed { plan, judgement } = executed.expect("a single process forms all tiles");
        Ok(judged(sink.image, &plan, &judgement))
    }
}

/// Image of `plan` with its measured error.
fn judged(image: Image, plan: &Plan, judgement: &Judgement) -> Formed {
    let mut settings = plan.summary.as_object().cloned().unwrap_or_default();
    if let Some(error_db) = plan.planned_for_db {
        settings.insert("planned_for_db".to_owned(), error_db.into());
    }
    let bound_missed = judgement.note(plan.bound_db, &mut settings);
    Formed {
        image,
        predicted_error_db: judgement.predicted_db(),
        bound_missed,
        settings,
    }
}
