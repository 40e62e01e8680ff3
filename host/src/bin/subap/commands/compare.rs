//! `subap compare`: how far apart two complex images are.

use anyhow::bail;
use subaperture::image::Comparison;
use subaperture::io::npy;

use crate::args::Compare;
use crate::text;

/// Prints the differences of the two images.
pub(crate) fn run(typed: &Compare) -> anyhow::Result<()> {
    let image = npy::read(&typed.image)?;
    let reference = npy::read(&typed.reference)?;
    if (image.rows, image.columns) != (reference.rows, reference.columns) {
        bail!(
            "{} has {} x {} pixels and {} has {} x {}: compare images of one grid",
            typed.image.display(),
            image.rows,
            image.columns,
            typed.reference.display(),
            reference.rows,
            reference.columns
        );
    }
    let comparison = Comparison::of(&image, &reference);
    text::say(comparison.to_string())?;
    Ok(())
}
