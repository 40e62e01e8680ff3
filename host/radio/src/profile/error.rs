//! Errors of range profiles and calibrations.

use crate::sigmf::SigmfError;

/// Reason why no range profile could be computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// The recording does not contain this sweep.
    #[error("the recording has no sweep {0}")]
    NoSweep(u64),
    /// Too few usable steps in a sweep.
    #[error(
        "{left} of {steps} steps are usable; expected at least two thirds: {}",
        "record again, or choose another sweep"
    )]
    TooFew {
        /// Number of usable steps.
        left: usize,
        /// Number of steps per sweep.
        steps: usize,
    },
    /// The options are invalid or do not fit the recording, with the reason.
    #[error("{0}")]
    Options(String),
    /// The leakage cannot serve as the reference.
    #[error("{0}")]
    Leakage(String),
    /// Invalid or unsuitable calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Reason why a calibration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The calibration was made with another set-up.
    #[error("the calibration of {date} was made with {what}: calibrate again")]
    Other {
        /// Date of the calibration.
        date: String,
        /// Difference between the set-ups.
        what: String,
    },
    /// The reflector is not visible.
    #[error(
        "no reflector found near {range_m} m: check its position, and that it is stronger than other echoes"
    )]
    NotSeen {
        /// Range at which the reflector was expected, metres.
        range_m: f64,
    },
    /// The file cannot be read or is invalid.
    #[error("{path}: {what}")]
    File {
        /// Path of the file.
        path: String,
        /// Fault of the file.
        what: String,
    },
}
