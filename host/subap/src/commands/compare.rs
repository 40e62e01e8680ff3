//! `subap compare`: how far apart two complex images are.

use subaperture::image::Comparison;

use super::stored;
use crate::args::Compare;
use crate::config::Session;
use crate::{messages, text};

/// Prints the differences of the two images.
pub(crate) fn run(session: &Session, typed: &Compare) -> anyhow::Result<()> {
    let progress = session.progress("comparing");
    let image = stored::open(&typed.image)?;
    let reference = stored::open(&typed.reference)?;
    image.check_same_grid(&reference)?;
    let comparison = Comparison::by_parts(&*image.pixels, &*reference.pixels)?;
    progress.finish();
    if let (Some(bound_db), Some(error_db)) = (typed.error_db, comparison.error_db)
        && error_db > bound_db
    {
        messages::bound_missed(format!(
            "the relative RMS error is {error_db:.1} dB, above the --error-db {bound_db} asked"
        ));
    }
    if session.json() {
        return text::say_json("comparison", comparison);
    }
    text::say(comparison.to_string())?;
    Ok(())
}
