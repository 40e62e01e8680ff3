//! Former of the registry: settings and choices of types of its own, from which [`ImageFormer`] follows.

use std::fmt::Debug;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::entry::Entry;
use super::error_bound::ErrorBound;
use crate::former_choices::FormerChoices;
use crate::{Decision, ErrorGoal, FormError, Forming, ImageFormer, ImageSpec};
use subaperture_model::monitor::Monitor;

/// Image formation algorithm of the registry ([`super::FORMERS`]).
pub(crate) trait Algorithm:
    ErrorBound + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Entry of the former in the registry.
    const ENTRY: Entry;

    /// Whether surfaces above the grid plane are supported, as [`ImageFormer::follows_relief`].
    const FOLLOWS_RELIEF: bool = false;

    /// Parameters chosen for an image, stored with its plan.
    type Choices: Clone + Debug + Serialize + DeserializeOwned + Send + Sync + 'static;

    /// Error bound for its images, dB, as [`ImageFormer::bound_db`].
    fn bound_db(&self) -> Option<f64> {
        Some(self.planned_bound_db())
    }

    /// Make the same former with a planned error of `error_db`, as [`ImageFormer::planning_for`].
    fn planning_for(&self, error_db: f64) -> Option<Self> {
        Some(self.with_planned_bound_db(error_db))
    }

    /// Whether intra-pulse motion is followed, as [`ImageFormer::follows_sweeps`].
    fn follows_sweeps(&self) -> bool {
        false
    }

    /// Decide how to form the image of `spec`, as [`ImageFormer::decide`].
    ///
    /// # Errors
    /// [`FormError`].
    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision<Self::Choices>, FormError>;

    /// Prepare to form the image of `spec` by `choices`, as [`ImageFormer::open`].
    ///
    /// # Errors
    /// [`FormError::Choices`] if `choices` do not belong to this image.
    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Self::Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError>;
}

impl<A: Algorithm> ImageFormer for A {
    fn name(&self) -> &'static str {
        A::ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        Algorithm::bound_db(self)
    }

    fn follows_sweeps(&self) -> bool {
        Algorithm::follows_sweeps(self)
    }

    fn follows_relief(&self) -> bool {
        A::FOLLOWS_RELIEF
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        let decision = Algorithm::decide(self, spec, goal, monitor)?;
        Ok(decision.map_choices(FormerChoices::new))
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Algorithm::open(self, spec, choices.of(A::ENTRY.name)?)
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        let former = Algorithm::planning_for(self, error_db)?;
        Some(Box::new(former))
    }
}
