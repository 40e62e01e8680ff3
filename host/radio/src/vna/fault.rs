//! Faults of a sweep.

use serde::{Deserialize, Serialize};

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// No connection could be opened.
    Unreachable,
    /// The connection was closed.
    Closed,
    /// No answer within the time-out.
    Timeout,
    /// A block ended early.
    Truncated,
    /// An answer of another form than expected.
    Malformed,
    /// A block longer than the limit.
    TooLong,
    /// Another number of points than set.
    Points,
    /// A value that is not a finite number.
    NotFinite,
    /// Other frequencies than set.
    Frequencies,
    /// Numbers in another byte order than announced.
    ByteOrder,
    /// An entry of the analyser's error queue.
    Instrument,
}

impl FaultKind {
    /// Whether the connection must be opened again, since answers may no longer belong to their questions or settings may be lost.
    pub(super) fn needs_reconnection(self) -> bool {
        !matches!(self, Self::Points | Self::NotFinite | Self::Instrument)
    }
}

/// Fault with its description.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Expected and found values, and where.
    pub message: String,
}

impl Fault {
    pub(super) fn new(kind: FaultKind, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { kind, message }
    }

    /// The fault with the question that was asked.
    pub(super) fn of(mut self, question: &str) -> Self {
        self.message = format!("{question}: {}", self.message);
        self
    }
}
