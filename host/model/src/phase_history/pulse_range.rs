//! Block of consecutive pulses of a phase history.

use std::ops::Range;

use num_complex::Complex32;

use super::{Beam, Collection, NoBeam, PhaseHistory, ReadError};
use crate::antenna::MountedAntennas;

/// Consecutive pulses of a phase history, presented as a phase history.
pub struct PulseRange<'a> {
    history: &'a dyn PhaseHistory,
    collection: Collection,
    first: usize,
}

impl<'a> PulseRange<'a> {
    /// Select the pulses `pulses` of `history`.
    ///
    /// # Panics
    /// Panics if `pulses` ends beyond the last pulse of `history`.
    pub fn new(history: &'a dyn PhaseHistory, pulses: Range<usize>) -> Self {
        let whole = history.collection();
        let first = pulses.start;
        Self {
            history,
            collection: Collection {
                pulses: whole.pulses[pulses].to_vec(),
                name: whole.name.clone(),
                ..*whole
            },
            first,
        }
    }

    /// Indices of the selected pulses in the whole history.
    pub fn pulses(&self) -> Range<usize> {
        self.first..self.first + self.collection.pulses.len()
    }

    /// Convert indices of selected pulses into indices of the whole history.
    fn within(&self, pulses: Range<usize>) -> Range<usize> {
        self.first + pulses.start..self.first + pulses.end
    }
}

impl PhaseHistory for PulseRange<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(self.within(pulses), samples)
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.samples_in_memory(self.within(pulses))
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        let mut mounted = self.history.antennas()?;
        mounted.attitudes = mounted.attitudes.get(self.pulses())?.to_vec();
        Some(mounted)
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }
}
