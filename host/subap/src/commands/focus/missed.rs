//! Messages for an image that exceeds the error bound, with alternatives.

use subaperture::focus::accuracy::passing_bound_db;
use subaperture::focus::{BoundPolicy, FormError, ImageFormer, ImageSpec, dark};
use subaperture::monitor::Monitor;

use crate::{advice, messages};

/// Warn that an image by `former` exceeds the error bound, and name the limiting approximation and a bound that would be kept.
/// The exit status reports it as well.
pub(super) fn warn(
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    predicted_db: f64,
    monitor: &dyn Monitor,
) {
    let bound_db = former.bound_db().unwrap_or_default();
    let mut text =
        format!("the predicted error is {predicted_db:.1} dB, above the bound of {bound_db} dB");
    // The plan names the limit, unless the plan keeps the bound and the scene amplifies the errors.
    let planned = former.decide(spec, &former.goal(BoundPolicy::Refused), monitor);
    let error = match planned {
        Err(error @ FormError::BoundMissed { .. }) => error,
        _ => FormError::BoundMissed {
            predicted_db,
            bound_db,
            limit: dark::reason(spec),
        },
    };
    if let FormError::BoundMissed { limit, .. } = &error {
        text += &format!(": {limit}{}", advice::after(&error).unwrap_or_default());
    }
    text += &with_bound(former, spec, predicted_db, monitor);
    messages::bound_missed(text);
}

/// Error for a refused image, with a bound that `former` would keep where it missed one.
pub(super) fn refusal(
    error: FormError,
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    monitor: &dyn Monitor,
) -> anyhow::Error {
    let FormError::BoundMissed { predicted_db, .. } = error else {
        return error.into();
    };
    let bound = with_bound(former, spec, predicted_db, monitor);
    anyhow::anyhow!(
        "{}{bound}, or use --allow-error to accept the smallest error possible",
        advice::with_advice(&error)
    )
}

/// Bound to suggest, as a continuation of "allow a larger error".
fn with_bound(
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    predicted_db: f64,
    monitor: &dyn Monitor,
) -> String {
    match passing_bound_db(former, spec, predicted_db, monitor) {
        Ok(Some(bound_db)) => format!(" with --error-db {bound_db:.1}"),
        _ => "; no --error-db below 0 can be kept, so that no useful image is possible".to_owned(),
    }
}

/// Add advice on options to a missed error bound.
pub(super) fn with_advice(error: FormError) -> anyhow::Error {
    match error {
        FormError::BoundMissed { .. } => {
            anyhow::anyhow!(
                "{}: raise --error-db, or use --allow-error to accept the smallest error possible",
                advice::with_advice(&error)
            )
        }
        error => error.into(),
    }
}
