//! Comparison of two images that may be on different grids.

use subaperture_model::image::{Comparison, ComparisonError, ImageSource as _};

use super::{OpenImage, Pair, PairError};

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Compared {
    /// Measures of similarity. Phase measures are `None` for amplitudes.
    pub comparison: Comparison,
    /// Whether complex values were compared; amplitudes otherwise.
    pub complex: bool,
    /// Number of pixels that both images contain.
    pub pixels: u64,
    /// Number of pixels of the common grid.
    pub of: u64,
    /// Processing steps and assumptions, one sentence each.
    pub notes: Vec<String>,
}

/// Error of comparing two images.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// Their pixels cannot be related.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// Their values cannot be compared.
    #[error(transparent)]
    Values(#[from] ComparisonError),
}

/// Compare an image with a reference on common pixels, related by metadata ([`Pair`]).
///
/// # Errors
/// [`CompareError`].
pub fn compare(image: &OpenImage, reference: &OpenImage) -> Result<Compared, CompareError> {
    let looks = [image.looks(), reference.looks()];
    let pair = Pair::new(image, reference, [looks[0].as_ref(), looks[1].as_ref()])?;
    let (rows, columns) = pair.reference.size();
    let of = rows as u64 * columns as u64;
    let (mut comparison, pixels) = match pair.whole {
        true => (Comparison::by_parts(&*pair.image, &*pair.reference)?, of),
        false => Comparison::on_common(&*pair.image, &*pair.reference)?,
    };
    if pixels == 0 {
        return Err(PairError {
            image: image.path.clone(),
            reference: reference.path.clone(),
            reason: "show different places: they have no pixel in common".to_owned(),
            unplaced: false,
        }
        .into());
    }
    if !pair.complex {
        comparison.scale_deg = None;
        comparison.peak_phase_error_deg = None;
    }
    Ok(Compared {
        comparison,
        complex: pair.complex,
        pixels,
        of,
        notes: pair.notes,
    })
}
