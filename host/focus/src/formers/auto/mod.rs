//! The fastest of the formers that take any track.
//!
//! Each of [`CANDIDATES`] plans the image within the same bound; of those that keep it that one forms it which takes the least time by the
//! time model. That is [`crate::ffbp`] wherever it takes the collection: an image too small to be factorised is one patch of its own, backprojected
//! at the rate of plain backprojection. [`crate::bp`] forms what `ffbp` refuses: bounds beyond its kernels, and antennas that move while a pulse
//! lasts, where each sample is to be taken at its own moment. Patches of one level ([`crate::rdbp`]) are no candidate: on every case that was
//! measured they took longer than `ffbp`, and planning them takes longer than forming a small image.
//!
//! Plans of the default time model are the same on every machine, and so is this choice. The choice is part of the plan, and the record's settings
//! say it (`former`).
//!
//! Error, cost and memory: those of the former that is taken. Planning takes that of both.

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::options::ERROR_DB;
use super::{Entry, FORMERS, former, of};
use crate::accuracy::misses;
use crate::former::{chosen, misfit};
use crate::{Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer};
use subaperture_model::monitor::Monitor;

/// By name; of two that are as fast the first.
pub const CANDIDATES: [&str; 2] = ["bp", "ffbp"];

/// The fastest former within a bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Auto {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

impl Default for Auto {
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
        }
    }
}

impl Auto {
    /// With this bound on the relative RMS error of the image, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db }
    }

    fn candidates(&self) -> impl Iterator<Item = Box<dyn ImageFormer>> {
        let named = |name: &&str| FORMERS.iter().find(|entry| entry.name == *name);
        let entries = CANDIDATES.iter().filter_map(named);
        entries.map(|entry| entry.within(self.error_db))
    }
}

/// In the list of formers.
pub(super) const ENTRY: Entry = Entry {
    name: "auto",
    summary: "the faster of bp and ffbp within the bound",
    options: &[ERROR_DB],
    of: of::<Auto>,
};

/// What a plan fixes.
#[derive(Serialize, Deserialize)]
struct Choices {
    /// Of [`CANDIDATES`].
    former: String,
    /// What it chose.
    choices: serde_json::Value,
}

impl ImageFormer for Auto {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn follows_relief(&self) -> bool {
        true
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn decide(
        &self,
        aim: &Aim,
        asked: &Asked,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        let sweeps = aim.collection.sweeps();
        let mut best: Option<(Decision, &'static str)> = None;
        let mut refusal = None;
        for former in self.candidates() {
            if sweeps && !former.follows_sweeps() {
                continue;
            }
            match former.decide(aim, asked, monitor) {
                Ok(own) => {
                    let better = best.as_ref().is_none_or(|(best, _)| {
                        // One that keeps the bound before one that does not, then the faster.
                        let rank = |of: &Decision| {
                            (misses(of.planned_db, asked.bound_db), of.cost.core_s())
                        };
                        rank(&own) < rank(best)
                    });
                    if better {
                        best = Some((own, former.name()));
                    }
                }
                Err(FormError::Cancelled) => return Err(FormError::Cancelled),
                // The first is the most exact, and says what limits it.
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        let Some((mut decision, name)) = best else {
            return Err(refusal.unwrap_or_else(|| FormError::unsuited("no former takes it")));
        };
        decision.choices = json!(Choices {
            former: name.to_owned(),
            choices: decision.choices,
        });
        decision.settings["former"] = name.into();
        Ok(decision)
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let Choices {
            former: name,
            choices,
        } = chosen(ENTRY.name, choices)?;
        if !CANDIDATES.contains(&name.as_str()) {
            return Err(misfit(ENTRY.name, "it is by another former"));
        }
        let settings = json!({ "error_db": self.error_db });
        let taken =
            former(&name, &settings).map_err(|error| misfit(ENTRY.name, &error.to_string()))?;
        taken.open(aim, &choices)
    }
}
