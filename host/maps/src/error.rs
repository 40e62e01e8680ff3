//! Errors of map making.

use subaperture_io::atomic::WriteError;
use subaperture_model::geometry::UtmError;
use subaperture_model::image::ImageSourceError;

/// Error of orthorectifying an image or writing a map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// The scene's position on the Earth is unknown.
    #[error("the scene has no position on the Earth; state the scene origin")]
    Local,
    /// The grid's plane is vertical; its orthographic projection is a line.
    #[error(
        "the image plane is upright (vertical) and projects to a line on a map; form the image on a flatter plane"
    )]
    Upright,
    /// The image's projection metadata place a pixel outside the Earth.
    #[error(
        "the image's metadata place row {row:.1}, column {column:.1} nowhere on the Earth: the geometry is inconsistent, or the edge lies beyond the horizon"
    )]
    Nowhere {
        /// Row, from 0.
        row: f64,
        /// Column, from 0.
        column: f64,
    },
    /// The record does not contain the image's spectral support.
    #[error(
        "the image's record contains no antenna positions (support); interpolation between pixels needs them"
    )]
    Unseen,
    /// The image is undersampled.
    #[error(
        "the image's bandwidth along {axis} is {cycles:.2} cycles per pixel, expected less than 1; form it \
         on a finer grid"
    )]
    Folded {
        /// Bandwidth, cycles per pixel.
        cycles: f64,
        /// `rows` or `columns`.
        axis: &'static str,
    },
    /// Map pixels are too coarse for complex values.
    #[error(
        "pixels of {pixel_m:.4} m are too coarse for complex values: expected {needed_m:.4} m or less; use smaller pixels, or \
         amplitudes, which are averaged"
    )]
    Coarse {
        /// Pixel spacing of the map, metres.
        pixel_m: f64,
        /// Pixel spacing of the image, metres.
        needed_m: f64,
    },
    /// The number of pixels is out of range.
    #[error("a map of {rows} x {columns} pixels of {pixel_m:.3e} m: {what}")]
    Size {
        /// Rows.
        rows: f64,
        /// Columns.
        columns: f64,
        /// Pixel spacing, metres.
        pixel_m: f64,
        /// Allowed range.
        what: &'static str,
    },
    /// The position has no UTM coordinates.
    #[error(transparent)]
    Utm(#[from] UtmError),
    /// The image could not be read.
    #[error(transparent)]
    ImageSource(ImageSourceError),
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The image has no finite pixel other than 0.
    #[error("expected at least one finite non-zero pixel, found none in the image")]
    Empty,
    /// Cancelled by the monitor.
    #[error("cancelled")]
    Cancelled,
}
