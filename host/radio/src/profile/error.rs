//! Why there is no profile, and why a calibration is of no use.

use crate::sigmf::SigmfError;

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// It has no such sweep.
    #[error("the recording has no sweep {0}")]
    NoSweep(u64),
    /// Too little is left of a sweep.
    #[error(
        "{left} of {steps} steps are usable, and a profile needs two of three: {}",
        "record again, or look at another sweep"
    )]
    TooFew {
        /// Steps left.
        left: usize,
        /// Steps of a sweep.
        steps: usize,
    },
    /// What was asked for makes no sense.
    #[error("{0}")]
    Options(String),
    /// The leakage is no reference here.
    #[error("{0}")]
    Leakage(String),
    /// The calibration is of something else.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Why a calibration is of no use.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// It was made with another set-up.
    #[error("the calibration of {date} was made with {what}: calibrate anew")]
    Other {
        /// Its date.
        date: String,
        /// What differs, and how.
        what: String,
    },
    /// Nothing is seen of the reflector.
    #[error(
        "no reflector is seen near {range_m} m: is it there, and larger than what else reflects?"
    )]
    NotSeen {
        /// Where it should be.
        range_m: f64,
    },
    /// The file.
    #[error("{path}: {what}")]
    File {
        /// Its path.
        path: String,
        /// What is wrong.
        what: String,
    },
}
