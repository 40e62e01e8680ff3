//! `subap compare`: how far apart two complex images are.

use std::fs;

use anyhow::bail;
use subaperture::image::Comparison;
use subaperture::io::npy;

use crate::args::Compare;
use crate::config::Session;
use crate::{messages, text};

/// Prints the differences of the two images.
pub(crate) fn run(session: &Session, typed: &Compare) -> anyhow::Result<()> {
    // A file that cannot be asked for its size cannot be read either, and reading says why.
    let bytes: u128 = [&typed.image, &typed.reference]
        .map(|path| fs::metadata(path).map_or(0, |about| u128::from(about.len())))
        .iter()
        .sum();
    if bytes > u128::from(session.memory_bytes) {
        bail!(
            "{} and {} need {}; --memory allows {}: raise --memory, or compare smaller images",
            typed.image.display(),
            typed.reference.display(),
            text::bytes(bytes),
            text::bytes(session.memory_bytes.into())
        );
    }
    let image = npy::read(&typed.image)?;
    let reference = npy::read(&typed.reference)?;
    let comparison = Comparison::between(&image, &reference)?;
    if typed.json {
        text::say(serde_json::to_string_pretty(&comparison)?)?;
    } else {
        text::say(comparison.to_string())?;
    }
    if let (Some(bound_db), Some(error_db)) = (typed.error_db, comparison.error_db)
        && error_db > bound_db
    {
        messages::bound_missed(format!(
            "the relative RMS error is {error_db:.1} dB, above the --error-db {bound_db} asked"
        ));
    }
    Ok(())
}
