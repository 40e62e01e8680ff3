//! Pulse counters of a run.

/// Counts of accepted and rejected pulses in one run. Every pulse is counted in exactly one of the first five fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PulseCounters {
    /// Pulses stored. They are part of a map unless their sub-CPI was discarded as incomplete.
    pub accepted: u32,
    /// Pulses never received, counted from gaps in the pulse numbers.
    pub lost: u32,
    /// Pulses whose number was received before, or that arrived after a later pulse.
    pub repeated: u32,
    /// Pulses rejected for a wrong number of samples, a value that is not finite, or the pulse number `u32::MAX`.
    pub refused: u32,
    /// Pulses dropped because both stores were full, or because the first pulse of their sub-CPI is missing.
    pub dropped: u32,
    /// Samples (not pulses) whose real or imaginary part is at a limit of the converter's range.
    pub at_limit: u32,
    /// Arithmetic results (not pulses) that saturated in fixed point.
    pub saturated: u32,
    /// Sub-CPIs (not pulses) discarded because a later pulse was missing after some had been accepted. A sub-CPI
    /// whose first pulse is missing is not counted here: its pulses count as `dropped`.
    pub incomplete: u32,
}
