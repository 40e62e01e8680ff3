//! Tracks with random components: perturbed tracks, and tracks measured by navigation.
//!
//! Both are as smooth as the underlying track. All random components depend only on the seed, not on the order of
//! evaluation.

mod navigated;
mod perturbed;
mod smooth_random;

use subaperture_model::track::{TrackError, turned};

pub use navigated::{Navigated, NavigationError};
pub use perturbed::{Perturbation, Perturbed};
pub use smooth_random::SmoothRandom;
