//! Error bounds and goals.

use super::error::{FormError, Reason};

/// Whether an image may exceed its error bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundPolicy {
    /// Exceeding the bound is the error [`FormError::BoundMissed`].
    Refused,
    /// Exceeding the bound is recorded with the image.
    Allowed,
}

/// Error requirement for an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorGoal {
    /// Bound on the relative RMS error, dB; `None` for no bound.
    pub bound_db: Option<f64>,
    /// Whether the bound may be exceeded.
    pub bound_policy: BoundPolicy,
}

impl ErrorGoal {
    /// Accept an image with predicted error `predicted_db`. `limit` names the limiting effect and a
    /// remedy.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`] if the prediction exceeds the bound and that is refused.
    pub fn check(
        &self,
        predicted_db: f64,
        limit: impl FnOnce() -> Reason,
    ) -> Result<(), FormError> {
        match self.bound_db {
            Some(bound_db)
                if self.bound_policy == BoundPolicy::Refused
                    && misses(predicted_db, Some(bound_db)) =>
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

/// Whether a prediction exceeds a bound; NaN does.
pub(super) fn misses(predicted_db: f64, bound_db: Option<f64>) -> bool {
    bound_db.is_some_and(|bound_db| predicted_db.is_nan() || predicted_db > bound_db)
}

/// Settings recorded with an image.
pub type Settings = serde_json::Map<String, serde_json::Value>;

/// Record the predicted error and its bound in settings. Return whether the bound is exceeded.
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

/// Default bound on the planned relative RMS error, dB.
pub const DEFAULT_ERROR_DB: f64 = -60.0;

/// Margin of the planned error below the error bound, dB.
///
/// The effect of a plan's error depends on the scene ([`crate::accuracy`]). The error measured on a sample of pixels
/// also varies, since a few bright reflectors can hold most of the image power: by +-3 dB on
/// random thousands of pixels of the GOTCHA scene. The margin keeps nearly all of this variation within the bound.
pub const MARGIN_DB: f64 = 4.0;
