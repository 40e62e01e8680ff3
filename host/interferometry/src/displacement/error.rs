//! Errors of displacement.

use super::areas::StableArea;

/// Error of measuring displacement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DisplacementError {
    /// Fewer than two passes.
    #[error("displacement: expected at least 2 passes, found {0}")]
    Passes(usize),
    /// Times and passes do not agree in number.
    #[error("times: expected one for each of {passes} passes, found {times}")]
    Times {
        /// Number of given passes.
        passes: usize,
        /// Number of given times.
        times: usize,
    },
    /// Times do not ascend.
    #[error(
        "times: expected a pass after that at {before_s} s, found one at {found_s} s (pass {pass}, counted from 0): give passes once each, earliest first"
    )]
    Order {
        /// Number of the later pass.
        pass: usize,
        /// Time of the pass before, seconds.
        before_s: f64,
        /// Time of the later pass, seconds.
        found_s: f64,
    },
    /// An image does not have the size of the grid.
    #[error(
        "pass {pass}: expected an image of the grid's {rows} rows x {columns} columns, found {found_rows} x {found_columns}"
    )]
    Size {
        /// Number of the pass.
        pass: usize,
        /// Rows of the grid.
        rows: usize,
        /// Columns of the grid.
        columns: usize,
        /// Rows of the image.
        found_rows: usize,
        /// Columns of the image.
        found_columns: usize,
    },
    /// A setting is out of range.
    #[error("{name}: expected {expected}, found {found}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Range of permitted values.
        expected: &'static str,
        /// Value that was given.
        found: f64,
    },
    /// Too few persistent points.
    #[error(
        "points: expected at least {least} with an amplitude dispersion up to {dispersion}, found {found} among {above_floor} pixels above the floor of {floor_db} dB: raise the dispersion, or lower the floor"
    )]
    TooFewPoints {
        /// Smallest number of points.
        least: usize,
        /// Number of points within the dispersion.
        found: usize,
        /// Number of pixels above the floor.
        above_floor: usize,
        /// Largest permitted amplitude dispersion.
        dispersion: f64,
        /// Floor relative to the median pixel, dB.
        floor_db: f64,
    },
    /// More points than permitted.
    #[error(
        "points: expected up to {most}, found more among {above_floor} pixels above the floor: raise the floor, lower the dispersion, choose local maxima, or permit more memory"
    )]
    TooManyPoints {
        /// Largest number of points.
        most: usize,
        /// Number of pixels above the floor.
        above_floor: usize,
    },
    /// A stable area has no point.
    #[error(
        "stable area {0}: expected persistent points, found none: check its position, or enlarge it"
    )]
    EmptyArea(StableArea),
    /// The stable areas do not determine the screen.
    #[error(
        "stable areas: expected at least {least} points at different ranges for the screen, found {found}: name larger areas, or use a screen that is constant over range"
    )]
    TooFewStable {
        /// Smallest number of points.
        least: usize,
        /// Number of points in stable areas.
        found: usize,
    },
    /// The ranges of the points do not determine a slope.
    #[error(
        "screen: expected points at different ranges, found ranges from {0:.3} to {1:.3} m: use a screen that is constant over range"
    )]
    Ranges(f64, f64),
}
