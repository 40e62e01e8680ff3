//! Automatic choice of the fastest former that supports any track.
//!
//! Each of [`CANDIDATES`] plans the image within the same bound. Among those that keep it, the former with the shortest time by the
//! timing model forms the image. That is [`crate::rdbp`] on a Cartesian plane of some hundred pixels or more, if the antennas rest during a pulse, and
//! [`crate::ffbp`] on other grids: an image too small for factorisation is a single patch, backprojected
//! as fast as by plain backprojection. [`crate::bp`] forms images that these refuse: bounds below the error of their kernels, and antennas with significant intra-pulse
//! motion, where each sample has its own antenna position. `rdbp` with patches of one level is not a candidate: it took longer than `ffbp` in every measured
//! case, and planning takes longer than forming a small image.
//!
//! Plans by the default timing model are the same on every machine, and so is this choice. The choice is part of the plan and appears in the settings of the
//! record (`former`).
//!
//! Error, cost and memory are those of the selected former. Planning takes the time of all.

use serde::{Deserialize, Serialize};

use super::algorithm::Algorithm;
use super::entry::Entry;
use super::error_bound::error_bound;
use super::options::ERROR_DB;
use super::{bp, ffbp, rdbp};
use crate::former_choices::{FormerChoices, misfit};
use crate::goal::{Settings, misses};
use crate::{Decision, ErrorGoal, FormError, Forming, ImageSpec};
use subaperture_model::monitor::Monitor;

/// Names of the candidates; the first wins if two are equally fast.
pub const CANDIDATES: [Entry; 3] = [
    bp::Backprojection::ENTRY,
    ffbp::FastFactorised::ENTRY,
    rdbp::RangeDopplerBackprojection::ENTRY,
];

/// Fastest former within a bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Auto {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

error_bound!(Auto {});

impl Auto {
    /// Plan of a candidate; `None` if it does not follow the antennas, or has no nested patches with maps.
    fn plan_of(
        &self,
        entry: &Entry,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Option<Decision>, FormError> {
        if entry.name == rdbp::RangeDopplerBackprojection::ENTRY.name {
            let former = rdbp::RangeDopplerBackprojection::default().error_db(self.error_db);
            let decision = former.nested(spec, goal)?;
            return Ok(decision.map(|own| own.map_choices(FormerChoices::new)));
        }
        let former = entry.within(self.error_db);
        if spec.collection.sweeps() && !former.follows_sweeps() {
            return Ok(None);
        }
        former.decide(spec, goal, monitor).map(Some)
    }
}

/// Name of the former that formed an image with these settings: the one that [`Auto`] selected, or `former` itself.
pub fn selected<'a>(settings: &'a Settings, former: &'a str) -> &'a str {
    let selected = settings.get("former").and_then(|name| name.as_str());
    selected.unwrap_or(former)
}

/// Parameters fixed by a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Choices {
    /// Name of the selected former, one of [`CANDIDATES`].
    former: String,
    /// Choices of the selected former.
    choices: FormerChoices,
}

impl Algorithm for Auto {
    const ENTRY: Entry = Entry::new::<Self>(
        "auto",
        "the fastest of bp, ffbp and rdbp within the bound",
        &[ERROR_DB],
    );

    const FOLLOWS_RELIEF: bool = true;

    type Choices = Choices;

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        let mut best: Option<(Decision, &'static str)> = None;
        let mut refusal = None;
        for entry in &CANDIDATES {
            match self.plan_of(entry, spec, goal, monitor) {
                Ok(None) => {}
                Ok(Some(own)) => {
                    let better = best.as_ref().is_none_or(|(best, _)| {
                        // A plan that keeps the bound ranks before one that does not, then the faster.
                        let rank = |of: &Decision| {
                            (misses(of.planned_db, goal.bound_db), of.cost.core_s())
                        };
                        rank(&own) < rank(best)
                    });
                    if better {
                        best = Some((own, entry.name));
                    }
                }
                Err(FormError::Cancelled) => return Err(FormError::Cancelled),
                // The refusal of the first candidate, the most exact former, states the limiting effect.
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        let Some((mut decision, name)) = best else {
            return Err(refusal.unwrap_or_else(|| FormError::unsuited("no former takes it")));
        };
        decision.settings["former"] = name.into();
        Ok(decision.map_choices(|choices| Choices {
            former: name.to_owned(),
            choices,
        }))
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let selected = |entry: &&Entry| entry.name == choices.former;
        let Some(entry) = CANDIDATES.iter().find(selected) else {
            return Err(misfit(
                Auto::ENTRY.name,
                "expected the plan of one of its candidates, found that of another former",
            ));
        };
        entry.within(self.error_db).open(spec, &choices.choices)
    }
}
