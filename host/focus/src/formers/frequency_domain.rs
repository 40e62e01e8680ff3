//! Formers along a straight track: [`Algorithm`] from a method of range focusing.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::algorithm::Algorithm;
use super::entry::Entry;
use super::error_bound::ErrorBound;
use crate::frequency_domain::{self, Choices, RangeMethod, Sizes, Stage, Strip};
use crate::{
    BoundPolicy, Decision, ErrorGoal, FormError, Formed, Forming, ImageSpec, Reason, Task, accuracy,
};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Collection;

/// Former with the common stages of [`crate::frequency_domain`].
pub(crate) trait FrequencyDomain:
    ErrorBound + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Entry of the former in the registry.
    const ENTRY: Entry;

    /// Transform from frequency to range.
    type Method: RangeMethod + 'static;

    /// Method for the pulses of `collection`.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if it does not support them.
    fn method(&self, collection: &Collection) -> Result<Self::Method, FormError>;

    /// Reason reported where the method limits the error.
    fn limit(&self) -> Reason;

    /// Settings of the method for the record: a JSON object.
    fn summary(&self) -> serde_json::Value {
        json!({})
    }
}

impl<F: FrequencyDomain> Algorithm for F {
    const ENTRY: Entry = F::ENTRY;

    type Choices = Choices;

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        let method = self.method(spec.collection)?;
        frequency_domain::decide(spec, &method, goal, &self.limit(), self.summary())
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let method = self.method(spec.collection)?;
        Ok(Box::new(Strip::new(spec, method, choices)?))
    }
}

/// Array sizes of `former` for the pixels of `grid`.
pub(super) fn sizes<F: FrequencyDomain>(
    former: &F,
    collection: &Collection,
    grid: &ImageGrid,
) -> Result<Sizes, FormError> {
    let method = former.method(collection)?;
    frequency_domain::sizes(collection, grid, &method, former.planned_bound_db())
}

/// Form the image as [`crate::ImageFormer::form_planned`], and pass every intermediate array to `observe`.
pub(super) fn form_observed<F: FrequencyDomain>(
    former: &F,
    task: &Task,
    observe: &mut dyn FnMut(&Stage),
) -> Result<Formed, FormError> {
    accuracy::keep_planned(
        former,
        task,
        BoundPolicy::Allowed,
        |decision, work, tiles| {
            let spec = task.spec();
            let method = former.method(spec.collection)?;
            let choices = decision.choices.of(F::ENTRY.name)?;
            Strip::new(spec, method, choices)?.form_observed(work, tiles, observe)
        },
    )
}

/// Give a former the methods that expose its intermediate arrays.
macro_rules! observable {
    ($former:ident) => {
        impl $former {
            /// Array sizes for the pixels of `grid`.
            ///
            /// # Errors
            /// [`FormError::Unsuited`], as for [`ImageFormer::form`](crate::ImageFormer::form).
            pub fn sizes(
                &self,
                collection: &Collection,
                grid: &ImageGrid,
            ) -> Result<Sizes, FormError> {
                $crate::formers::frequency_domain::sizes(self, collection, grid)
            }

            /// Form the image as [`ImageFormer::form_planned`](crate::ImageFormer::form_planned), and pass every intermediate array to `observe`.
            ///
            /// # Errors
            /// Errors of [`ImageFormer::form_planned`](crate::ImageFormer::form_planned).
            pub fn form_observed(
                &self,
                task: &Task,
                observe: &mut dyn FnMut(&Stage),
            ) -> Result<Formed, FormError> {
                $crate::formers::frequency_domain::form_observed(self, task, observe)
            }
        }
    };
}

pub(super) use observable;
