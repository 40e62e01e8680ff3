//! Where the pulses of a run went.

/// What became of the pulses; every one is in one of the first five.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PulseCounters {
    /// Stored, and in a map unless its sub-CPI was given up.
    pub accepted: u32,
    /// Never came: gaps in the numbers.
    pub lost: u32,
    /// Came again, or too late.
    pub repeated: u32,
    /// Could not be used: a wrong length, not a number, or the largest number that there is.
    pub refused: u32,
    /// Came while both stores were full, or in the middle of a sub-CPI whose beginning is missing.
    pub dropped: u32,
    /// Samples (not pulses) with a part at an end of the converter's range.
    pub at_limit: u32,
    /// Arithmetic results (not pulses) that had to be clamped.
    pub saturated: u32,
    /// Sub-CPIs (not pulses) given up after some of their pulses had been accepted, because a later one
    /// was missing. One that misses its first is never begun: its pulses are dropped.
    pub incomplete: u32,
}
