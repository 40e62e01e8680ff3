//! Errors of arrays of a phase history.

/// Reason why arrays are not a phase history.
pub(super) enum Fault {
    /// Description of the fault, with the name of the array.
    Malformed(String),
    /// Bytes needed.
    Memory(u64),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Malformed(what)
    }
}
