//! Messages for an image that exceeds the error bound, with alternatives.

use subaperture::focus::accuracy::passing_bound_db;
use subaperture::focus::{BoundPolicy, FormError, ImageFormer, ImageSpec, dark};
use subaperture::monitor::Monitor;

use crate::{advice, messages};

/// Warns of an image of `former` that is worse than asked, says what limits it, and the bound that it would keep. The exit status
/// says so too.
pub(super) fn tell(
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    predicted_db: f64,
    monitor: &dyn Monitor,
) {
    let bound_db = former.bound_db().unwrap_or_default();
    let mut text =
        format!("the predicted error is {predicted_db:.1} dB, above the {bound_db} dB asked");
    // The plan contains the limit, unless it keeps the bound and the scene enlarges the errors.
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

/// A refusal of `former`, with the bound that it would keep where it misses one.
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
        "{}{bound}, or take the best there is with --allow-error",
        advice::explained(&error)
    )
}

/// The bound to ask for, as it goes on after "allow a larger error".
fn with_bound(
    former: &dyn ImageFormer,
    spec: &ImageSpec,
    predicted_db: f64,
    monitor: &dyn Monitor,
) -> String {
    match passing_bound_db(former, spec, predicted_db, monitor) {
        Ok(Some(bound_db)) => format!(" with --error-db {bound_db:.1}"),
        _ => "; no --error-db below 0 would pass, so that the image is worth nothing".to_owned(),
    }
}
