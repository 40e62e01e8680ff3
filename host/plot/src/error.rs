//! Errors of plots.

use subaperture_model::image::ImageSourceError;

/// Error of drawing a picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The input cannot be drawn.
    #[error("cannot draw {title:?}: {what}")]
    Unsuited {
        /// Title of the panel.
        title: String,
        /// Reason why the data cannot be drawn.
        what: String,
    },
    /// An image could not be read.
    #[error(transparent)]
    ImageSource(ImageSourceError),
    /// The picture could not be encoded.
    #[error("cannot encode the picture: {0}")]
    Encoding(#[from] png::EncodingError),
}
