//! Why an image is not put on a map.

use subaperture_io::atomic::WriteError;
use subaperture_model::geometry::UtmError;
use subaperture_model::image::PartsError;

/// Why an image is not put on a map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// Nobody said where on the Earth the scene is.
    #[error("the scene is tied to no place on the Earth")]
    Local,
    /// The grid's plane stands upright: a map shows it as a line.
    #[error(
        "the image's plane stands upright, so that a map sees it edge on: form the image on a plane that lies flatter"
    )]
    Upright,
    /// The image's own metadata put a pixel nowhere.
    #[error(
        "the image's metadata put row {row:.1}, column {column:.1} nowhere on the Earth: its geometry contradicts itself, or its edge lies beyond the horizon"
    )]
    Nowhere {
        /// Row, from 0.
        row: f64,
        /// Column, from 0.
        column: f64,
    },
    /// Nothing is known of the image's spectrum.
    #[error(
        "the image's record does not say from where it was seen (support), without which it cannot be read between pixels"
    )]
    Unseen,
    /// The pixels are too far apart for the image's band.
    #[error(
        "the image's band is {cycles:.2} cycles a pixel along its {axis}, where one is the most that pixels can hold: form it \
         on a finer grid"
    )]
    Folded {
        /// Width of the band, cycles a pixel.
        cycles: f64,
        /// `rows` or `columns`.
        axis: &'static str,
    },
    /// The map's pixels are too far apart for complex values.
    #[error(
        "pixels of {pixel_m:.4} m are too coarse for complex values, which need {needed_m:.4} m or less: give smaller ones, or \
         choose amplitudes, which are averaged"
    )]
    Coarse {
        /// The map's, metres.
        pixel_m: f64,
        /// The image's, metres.
        needed_m: f64,
    },
    /// The map has too many pixels, or too few.
    #[error("a map of {rows} x {columns} pixels of {pixel_m:.3e} m: {what}")]
    Size {
        /// Rows.
        rows: f64,
        /// Columns.
        columns: f64,
        /// Of one pixel, metres.
        pixel_m: f64,
        /// What is possible.
        what: &'static str,
    },
    /// The place has no such coordinates.
    #[error(transparent)]
    Utm(#[from] UtmError),
    /// A part of the image could not be read.
    #[error(transparent)]
    Parts(PartsError),
    /// The file was not written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// There is nothing in the image.
    #[error("the image is zero or not finite everywhere: there is nothing to show")]
    Empty,
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
