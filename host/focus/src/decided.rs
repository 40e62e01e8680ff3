//! One decision for all who ask: planning that is told before the work, and then carried out.

use std::sync::{Mutex, PoisonError};

use crate::accuracy::misses;
use crate::{Aim, Asked, Decision, FormError, Forming, ImageFormer, Misses};
use subaperture_model::monitor::Monitor;

/// A former that decides once how the image of one aim is formed, however often it is asked, and is else the former that it was
/// made of.
pub struct DecidedOnce<'a> {
    former: &'a dyn ImageFormer,
    aim: Aim<'a>,
    /// The decision, and the bound that it was made for.
    made: Mutex<Option<(Decision, Option<f64>)>>,
}

impl<'a> DecidedOnce<'a> {
    /// `former`, to form the image of `aim`.
    pub fn new(former: &'a dyn ImageFormer, aim: Aim<'a>) -> Self {
        Self {
            former,
            aim,
            made: Mutex::default(),
        }
    }

    /// Whether that is the very aim, and no other that looks like it.
    fn is_of(&self, aim: &Aim) -> bool {
        let own = &self.aim;
        std::ptr::eq(own.collection, aim.collection)
            && std::ptr::eq(own.grid, aim.grid)
            && std::ptr::eq(own.weights, aim.weights)
            && own.scratch_bytes == aim.scratch_bytes
            && own.means == aim.means
    }
}

impl ImageFormer for DecidedOnce<'_> {
    fn name(&self) -> &'static str {
        self.former.name()
    }

    fn settings(&self) -> serde_json::Value {
        self.former.settings()
    }

    fn bound_db(&self) -> Option<f64> {
        self.former.bound_db()
    }

    fn follows_sweeps(&self) -> bool {
        self.former.follows_sweeps()
    }

    fn follows_relief(&self) -> bool {
        self.former.follows_relief()
    }

    fn decide(
        &self,
        aim: &Aim,
        asked: &Asked,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        if !self.is_of(aim) {
            return self.former.decide(aim, asked, monitor);
        }
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((decision, bound_db)) = &*made
            && *bound_db == asked.bound_db
            // Whoever refuses a miss is to be told why, by the former.
            && (asked.misses == Misses::Allowed || !misses(decision.planned_db, asked.bound_db))
        {
            return Ok(decision.clone());
        }
        let decision = self.former.decide(aim, asked, monitor)?;
        *made = Some((decision.clone(), asked.bound_db));
        Ok(decision)
    }

    fn open<'f>(
        &self,
        aim: Aim<'f>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'f>, FormError> {
        self.former.open(aim, choices)
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        self.former.planning_for(error_db)
    }
}
