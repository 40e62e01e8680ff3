//! Why a point was not measured.

use subaperture_model::image::PartsError;

use super::LEAST_PEAK_DB;

/// Why a point was not measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResponseError {
    /// The image and its grid differ, or a position is not on it.
    #[error("{0}")]
    Unsuited(String),
    /// No room for a chip.
    #[error(
        "the peak at row {row}, column {column} is too close to the border: {room} pixels are there \
         and {needed} needed; form the image on a larger grid, or choose another point"
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
    /// Pixels too far apart for what the pulses sample there.
    #[error(
        "the pixels are too coarse to measure the point at {along} {at:.4}: they are {step:.4} apart along {along}, and {needed:.4} or \
         less is needed where spatial frequencies span {extent:.2} cycles for each of them; form the image on a finer grid"
    )]
    TooCoarse {
        /// The axis: x or y, angle or range.
        along: &'static str,
        /// The peak on it: metres, or radians of an angle.
        at: f64,
        /// Distance from pixel to pixel, in the same unit.
        step: f64,
        /// The most that will do.
        needed: f64,
        /// Extent of the support along the axis.
        extent: f64,
    },
    /// A part of the image could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// Nothing stands out.
    #[error(
        "no point at row {row}, column {column}: the brightest pixel there is {above_db:.1} dB above \
         the median around it, and {LEAST_PEAK_DB} dB are needed to tell a point from noise"
    )]
    NoPeak {
        /// Row of the brightest pixel.
        row: usize,
        /// Its column.
        column: usize,
        /// How far it stands out, dB.
        above_db: f64,
    },
    /// A pixel around the point is NaN or infinite.
    #[error("the image is not finite around row {row}, column {column}")]
    NotFinite {
        /// Row of the point.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl ResponseError {
    /// The same of an image that begins so many rows and columns before.
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

pub(super) fn unreadable(error: PartsError) -> ResponseError {
    ResponseError::Unreadable(error.to_string())
}
