//! Why no image was formed, and what would help: told apart from how anybody asks for it.

use std::borrow::Cow;
use std::fmt;

use subaperture_model::phase_history::ReadError;
use subaperture_model::quantity::bytes;

/// What would help. Who knows how it is asked for makes advice of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// More memory.
    MoreMemory,
    /// Another former, one of these names.
    OtherFormer(&'static [&'static str]),
    /// A word of an option of the former.
    Word {
        /// The option's name.
        option: &'static str,
        /// Its word.
        word: &'static str,
    },
    /// Less of one of these options of the former.
    Smaller(&'static [&'static str]),
    /// More of an option of the former.
    Larger(&'static str),
    /// Leaving these options of the former to its plan.
    LeftOut(&'static [&'static str]),
    /// A grid, where none was given.
    SomeGrid,
    /// A smaller grid.
    SmallerGrid,
    /// A smaller or coarser grid.
    FewerPixels,
    /// A grid farther away or narrower.
    FartherGrid,
    /// A grid without what was named.
    GridWithout,
    /// A grid with what was named.
    GridWith,
    /// A plan for this error, dB.
    PlanFor {
        /// What to plan for.
        error_db: f64,
    },
}

/// Why something cannot be, in words that name what is wrong, with its numbers; and what would help.
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// What is wrong.
    pub why: Cow<'static, str>,
    /// Any one of these would help, the likeliest first; none are known if it is empty.
    pub remedies: Vec<Remedy>,
}

impl Reason {
    /// Without a remedy.
    pub fn new(why: impl Into<Cow<'static, str>>) -> Self {
        Self {
            why: why.into(),
            remedies: Vec::new(),
        }
    }

    /// With what would help.
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

/// Why no image was formed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormError {
    /// Pulses could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The work does not fit the budget.
    #[error("{what} needs {} of the {} allowed", bytes(*needed_bytes), bytes((*budget_bytes).into()))]
    Memory {
        /// What asked for it.
        what: &'static str,
        /// Bytes needed at the least.
        needed_bytes: u128,
        /// Bytes allowed.
        budget_bytes: u64,
        /// What would help.
        remedies: &'static [Remedy],
    },
    /// Choices of a plan that are not this former's, or do not fit what is to be formed.
    #[error("the plan is none of {former}'s for this recording and grid: {what}")]
    Choices {
        /// The former's name.
        former: &'static str,
        /// What does not fit.
        what: String,
    },
    /// The collection or the settings do not suit this former.
    #[error("{0}")]
    Unsuited(Reason),
    /// The image would err, or errs, by more than was asked.
    #[error("the predicted error is {predicted_db:.1} dB, above the {bound_db} dB asked: {limit}")]
    BoundMissed {
        /// Predicted relative RMS error, dB.
        predicted_db: f64,
        /// Bound asked, dB.
        bound_db: f64,
        /// What limits it.
        limit: Reason,
    },
    /// A pixel of the image is NaN or infinite.
    #[error(
        "pixel ({row}, {column}) of the image, at {position_m:?} m, is not a finite number: a position, a frequency \
         or a sample of the recording is beyond what can be computed with; repair it"
    )]
    NotFinite {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// Its place in the scene frame.
        position_m: [f64; 3],
    },
    /// A former left pulses out: a fault of it.
    #[error("not all pulses were read: this is a fault of the former")]
    PulsesLeftOut,
    /// A formed tile was not taken.
    #[error(transparent)]
    Sink(Box<dyn std::error::Error + Send + Sync>),
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}

impl FormError {
    /// A collection or settings that do not suit, and nothing but another of them helps.
    pub fn unsuited(why: impl Into<Cow<'static, str>>) -> Self {
        Self::Unsuited(Reason::new(why))
    }

    /// What would help, beside a larger bound where one is missed.
    pub fn remedies(&self) -> &[Remedy] {
        match self {
            Self::Memory { remedies, .. } => remedies,
            Self::Unsuited(reason) | Self::BoundMissed { limit: reason, .. } => &reason.remedies,
            _ => &[],
        }
    }
}
