//! A run of pulses of a phase history.

use std::ops::Range;

use num_complex::Complex32;

use super::{Collection, PhaseHistory, ReadError};

/// Some pulses of a history, one after another, as a history of their own.
pub struct Stretch<'a> {
    history: &'a dyn PhaseHistory,
    collection: Collection,
    first: usize,
}

impl<'a> Stretch<'a> {
    /// The pulses `pulses` of `history`.
    ///
    /// # Panics
    /// If it has not so many.
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

    /// Which pulses of the history they are.
    pub fn pulses(&self) -> Range<usize> {
        self.first..self.first + self.collection.pulses.len()
    }

    /// Pulses of the history that some of these are.
    fn within(&self, pulses: Range<usize>) -> Range<usize> {
        self.first + pulses.start..self.first + pulses.end
    }
}

impl PhaseHistory for Stretch<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(self.within(pulses), samples)
    }

    fn at_hand(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.at_hand(self.within(pulses))
    }

    fn held_bytes(&self) -> u64 {
        self.history.held_bytes() + size_of_val(self.collection.pulses.as_slice()) as u64
    }
}
