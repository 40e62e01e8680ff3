//! Errors of image formation with possible remedies, independent of any user interface.

use std::borrow::Cow;
use std::fmt;

use crate::device::DeviceError;
use subaperture_model::phase_history::ReadError;
use subaperture_model::quantity::bytes;

/// Remedy for an error. The user interface turns it into advice.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// Raise the memory limit.
    MoreMemory,
    /// Use another former, one of these names.
    OtherFormer(&'static [&'static str]),
    /// Choose a word for an option of the former.
    Word {
        /// Name of the option.
        option: &'static str,
        /// Word to choose for the option.
        word: &'static str,
    },
    /// Reduce one of these options of the former.
    Smaller(&'static [&'static str]),
    /// Increase an option of the former.
    Larger(&'static str),
    /// Omit these options, so that the former plans them.
    LeftOut(&'static [&'static str]),
    /// Give a grid.
    SomeGrid,
    /// Reduce the grid extent.
    SmallerGrid,
    /// Reduce the grid extent or the pixel density.
    FewerPixels,
    /// Move the grid farther away or make it narrower.
    FartherGrid,
    /// Exclude the named points from the grid.
    GridWithout,
    /// Include the named points in the grid.
    GridWith,
    /// Reduce the spacing of the pixels.
    FinerGrid,
    /// Plan for a given error.
    PlanFor {
        /// Error to plan for, dB.
        error_db: f64,
    },
}

/// Reason of an error, with its values, and possible remedies.
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// Description of the problem.
    pub why: Cow<'static, str>,
    /// Alternative remedies, the most likely first; empty if no remedy is known.
    pub remedies: Vec<Remedy>,
}

impl Reason {
    /// Make a reason without a remedy.
    pub fn new(why: impl Into<Cow<'static, str>>) -> Self {
        Self {
            why: why.into(),
            remedies: Vec::new(),
        }
    }

    /// Add remedies to the reason.
    #[must_use]
    pub fn helped_by(mut self, remedies: &[Remedy]) -> Self {
        self.remedies.extend_from_slice(remedies);
        self
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)
    }
}

/// Error of image formation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormError {
    /// Reading the pulses failed.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The device that forms the image failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The memory limit is too small.
    #[error("{purpose} needs {} of the {} allowed", bytes(*needed_bytes), bytes((*budget_bytes).into()))]
    Memory {
        /// Purpose of the memory.
        purpose: &'static str,
        /// Minimum memory needed, bytes.
        needed_bytes: u128,
        /// Memory limit, bytes.
        budget_bytes: u64,
        /// Possible remedies.
        remedies: &'static [Remedy],
    },
    /// The choices of a plan belong to a different former, or do not fit the recording and grid.
    #[error("the plan was not made by {former} for this recording and grid: {mismatch}")]
    Choices {
        /// Name of the former.
        former: &'static str,
        /// Description of the mismatch.
        mismatch: String,
    },
    /// The collection or the settings are unsuitable for this former.
    #[error("{0}")]
    Unsuited(Reason),
    /// The predicted or measured error exceeds the error bound.
    #[error(
        "the predicted error is {predicted_db:.1} dB, above the requested bound of {bound_db} dB: {limit}"
    )]
    BoundMissed {
        /// Predicted relative RMS error, dB.
        predicted_db: f64,
        /// Requested error bound, dB.
        bound_db: f64,
        /// Effect that limits the error.
        limit: Reason,
    },
    /// A pixel of the image is NaN or infinite.
    #[error(
        "pixel ({row}, {column}) of the image, at {position_m:?} m, is not a finite number: a position, a frequency \
         or a sample of the recording is too large for the computation; repair it"
    )]
    NotFinite {
        /// Row of the pixel, from 0.
        row: usize,
        /// Column of the pixel, from 0.
        column: usize,
        /// Position of the pixel in the scene frame, metres.
        position_m: [f64; 3],
    },
    /// The former did not read all pulses, which is a defect of the former.
    #[error("not all pulses were read: this is a defect of the former")]
    PulsesLeftOut,
    /// The receiver of tiles failed.
    #[error(transparent)]
    Sink(Box<dyn std::error::Error + Send + Sync>),
    /// The monitor cancelled the work.
    #[error("interrupted")]
    Cancelled,
}

impl FormError {
    /// Make an error for an unsuitable collection or setting without a remedy.
    pub fn unsuited(why: impl Into<Cow<'static, str>>) -> Self {
        Self::Unsuited(Reason::new(why))
    }

    /// Remedies of the error, apart from a larger error bound where the bound is exceeded.
    pub fn remedies(&self) -> &[Remedy] {
        match self {
            Self::Memory { remedies, .. } => remedies,
            Self::Unsuited(reason) | Self::BoundMissed { limit: reason, .. } => &reason.remedies,
            _ => &[],
        }
    }
}

/// Invalid former name, beam or settings.
#[derive(Debug, thiserror::Error)]
pub enum UnknownFormer {
    /// No former has this name.
    #[error("no former '{name}': expected one of {}", known.join(", "))]
    Name {
        /// Requested name.
        name: String,
        /// Names of all formers.
        known: Vec<&'static str>,
    },
    /// The beam is invalid.
    #[error("{0}")]
    Beam(String),
    /// The settings are invalid.
    #[error("settings of {name}: {source}")]
    Settings {
        /// Name of the former.
        name: &'static str,
        /// Parse error of the settings.
        source: serde_json::Error,
    },
}
