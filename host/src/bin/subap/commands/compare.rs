//! `subap compare`: how far apart two complex images are.

use subaperture::image::Comparison;
use subaperture::io::npy;

use crate::args::Compare;
use crate::text;

/// Prints the differences of the two images.
pub(crate) fn run(typed: &Compare) -> anyhow::Result<()> {
    let image = npy::read(&typed.image)?;
    let reference = npy::read(&typed.reference)?;
    let comparison = Comparison::between(&image, &reference)?;
    if typed.json {
        text::say(serde_json::to_string_pretty(&comparison)?)?;
    } else {
        text::say(comparison.to_string())?;
    }
    Ok(())
}
