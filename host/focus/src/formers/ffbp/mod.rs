//! Fast factorised backprojection: nested patches of pixels whose histories are decimated (`factorised`), and plain
//! backprojection of the smallest.

use super::Entry;
use super::algorithm::Algorithm;
use super::error_bound::error_bound;
use super::options::ERROR_DB;
use crate::factorised::{self, Leaves};
use crate::{Decision, ErrorGoal, FormError, Forming, ImageSpec};
use subaperture_model::monitor::Monitor;

/// Fast factorised backprojection.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastFactorised {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

error_bound!(FastFactorised {});

impl Algorithm for FastFactorised {
    const ENTRY: Entry = Entry::new::<Self>(
        "ffbp",
        "fast factorised backprojection: patches within patches, any track",
        &[ERROR_DB],
    );

    const FOLLOWS_RELIEF: bool = true;

    type Choices = factorised::Choices;

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision<factorised::Choices>, FormError> {
        let decision = factorised::decide(self.error_db, Leaves::Pulses, spec, goal)?;
        Ok(decision.expect("every image has leaves of pulses"))
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: factorised::Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        factorised::open(Self::ENTRY.name, spec, choices)
    }
}
