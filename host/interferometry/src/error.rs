//! Errors.

use subaperture_quality::PairError;

use crate::statistics::{MAX_COHERENCE, MAX_LOOKS};

/// Error of processing a coherent pair of images.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InterferometryError {
    /// The images differ in size, or a window or an image is not valid.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// The window is too small or exceeds the image.
    #[error(
        "window: expected odd numbers of rows and columns, at least 3 pixels, within half of the image of {image_rows} x {image_columns} pixels; found \
         {rows} x {columns}"
    )]
    Window {
        /// Rows of the window.
        rows: usize,
        /// Columns of the window.
        columns: usize,
        /// Rows of the image.
        image_rows: usize,
        /// Columns of the image.
        image_columns: usize,
    },
    /// The magnitudes correlate too little for registration.
    #[error(
        "registration: expected a correlation of the magnitudes above {least:.3}, found {correlation:.3} at an offset of {rows:.2} rows, {columns:.2} \
         columns: the images may show different places, or have no common structure; check their grids"
    )]
    Uncorrelated {
        /// Correlation at the best offset.
        correlation: f64,
        /// Smallest correlation that is trusted.
        least: f64,
        /// Best offset along rows, pixels.
        rows: f64,
        /// Best offset along columns, pixels.
        columns: f64,
    },
    /// The number of looks has no distribution here.
    #[error(
        "independent looks: expected a number above 1 and up to {MAX_LOOKS}, found {0:.2}: use another window"
    )]
    Looks(f64),
    /// The coherence is out of range.
    #[error("coherence: expected 0 to {MAX_COHERENCE}, found {0}")]
    Coherence(f64),
    /// The probability is out of range.
    #[error("probability: expected a number between 0 and 1, found {0}")]
    Probability(f64),
    /// No pixel can be tested.
    #[error(
        "expected pixels with a full window and power in both images, found none among {0}: use images that overlap, or a smaller window"
    )]
    Empty(usize),
}
