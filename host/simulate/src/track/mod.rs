//! Tracks with something random about them: disturbed ones, and what navigation makes of them.
//!
//! Both are as smooth as the track within. Everything random depends on the seed alone, not on the order of evaluation.

mod navigated;
mod perturbed;
mod smooth_random;

use subaperture_model::track::{TrackError, turned};

pub use navigated::{Navigated, NavigationError};
pub use perturbed::{Perturbation, Perturbed};
pub use smooth_random::SmoothRandom;
