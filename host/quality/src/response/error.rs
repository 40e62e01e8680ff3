//! Errors of point measurements.

use subaperture_model::image::ImageSourceError;

use super::MIN_PEAK_DB;

/// Error of measuring an impulse response.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResponseError {
    /// Image and grid differ in size, or a position is outside the image.
    #[error("{0}")]
    Unsuited(String),
    /// The point is too close to the image border.
    #[error(
        "the peak at row {row}, column {column} is too close to the border: expected {needed} pixels to the border, \
         found {room}; form the image on a larger grid, or choose another point"
    )]
    Border {
        /// Row of the brightest pixel.
        row: usize,
        /// Its column.
        column: usize,
        /// Pixels to the nearest border.
        room: usize,
        /// Pixels needed.
        needed: usize,
    },
    /// The pixel spacing undersamples the spectral support.
    #[error(
        "the pixels are too coarse to measure the point at {along} {at:.4}: they are {step:.4} apart along {along}; a support of {extent:.2} \
         cycles per unit needs {needed:.4} or less; form the image on a finer grid"
    )]
    TooCoarse {
        /// Axis: x or y, angle or range.
        along: &'static str,
        /// Position of the peak on the axis: metres, or radians for an angle.
        at: f64,
        /// Pixel spacing, in the same unit.
        step: f64,
        /// Largest sufficient spacing, in the same unit.
        needed: f64,
        /// Extent of the support along the axis, cycles per unit.
        extent: f64,
    },
    /// The image could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// The pixels around the point exceed the memory limit.
    #[error(
        "measuring the point needs {needed_bytes} bytes of memory, {allowed_bytes} are allowed; allow more memory, or form the image on a \
         coarser grid"
    )]
    Memory {
        /// Bytes needed.
        needed_bytes: u64,
        /// Bytes allowed.
        allowed_bytes: u64,
    },
    /// No pixel stands out of the background.
    #[error(
        "no point at row {row}, column {column}: the brightest pixel is {above_db:.1} dB above \
         the local median, expected {MIN_PEAK_DB} dB or more"
    )]
    NoPeak {
        /// Row of the brightest pixel.
        row: usize,
        /// Its column.
        column: usize,
        /// Level above the local median, dB.
        above_db: f64,
    },
    /// A pixel around the point is NaN or infinite.
    #[error("expected finite pixels around row {row}, column {column}, found NaN or infinity")]
    NotFinite {
        /// Row of the point.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl ResponseError {
    /// The same error in an image that begins `rows` and `columns` earlier.
    pub(super) fn shifted(self, rows: usize, columns: usize) -> Self {
        match self {
            Self::NoPeak {
                row,
                column,
                above_db,
            } => Self::NoPeak {
                row: row + rows,
                column: column + columns,
                above_db,
            },
            Self::Border {
                row,
                column,
                room,
                needed,
            } => Self::Border {
                row: row + rows,
                column: column + columns,
                room,
                needed,
            },
            Self::NotFinite { row, column } => Self::NotFinite {
                row: row + rows,
                column: column + columns,
            },
            other => other,
        }
    }
}

pub(super) fn unreadable(error: ImageSourceError) -> ResponseError {
    ResponseError::Unreadable(error.to_string())
}
