//! Pulse stores of the stream processor.

use super::{Sample, Setup};
use crate::Pulse;

/// Store of the raw pulses of one sub-CPI, channel by channel: `[C][M]` rows of samples.
#[derive(Debug)]
pub struct Store<'a, S> {
    pub(super) samples: &'a mut [S],
    pub(super) pulses: &'a mut [Pulse],
    /// Number of pulses stored.
    pub(super) count: usize,
    /// Whether the sub-CPI is complete and waiting for, or in, processing.
    pub(super) full: bool,
}

impl<'a, S> Store<'a, S> {
    /// Create a store on borrowed buffers of `M F` samples and `M` pulses, each for the maximum that the capacity
    /// states. [`SubCpiProcessor::from_parts`](super::SubCpiProcessor::from_parts) checks the lengths.
    pub fn new(samples: &'a mut [S], pulses: &'a mut [Pulse]) -> Self {
        Self {
            samples,
            pulses,
            count: 0,
            full: false,
        }
    }

    /// Pulse stored last.
    pub(super) fn last_pulse(&self, setup: &Setup) -> Option<&Pulse> {
        let last = self.count.checked_sub(1)?;
        self.pulses.get(row_of(setup, last))
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.full = false;
    }
}

/// Row of the pulse that was pushed as number `place` of its sub-CPI.
pub(super) fn row_of(setup: &Setup, place: usize) -> usize {
    let channels = usize::from(setup.num_channels).max(1);
    place % channels * usize::from(setup.num_pulses) + place / channels
}

/// Two pulse stores with samples of type `S`, statically sized.
#[derive(Debug)]
pub struct PulseStores<S, const PULSES: usize, const FREQUENCIES: usize> {
    samples: [[[S; FREQUENCIES]; PULSES]; 2],
    pulses: [[Pulse; PULSES]; 2],
}

impl<S: Sample, const PULSES: usize, const FREQUENCIES: usize> PulseStores<S, PULSES, FREQUENCIES> {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty stores. All bytes are zero.
    pub const fn new() -> Self {
        const {
            assert!(
                PULSES >= 1 && PULSES <= 4096 && FREQUENCIES >= 1 && FREQUENCIES <= 4096,
                "PULSES and FREQUENCIES must be 1 to 4096"
            );
        };
        Self {
            samples: [[[S::ZERO; FREQUENCIES]; PULSES]; 2],
            pulses: [[Pulse::EMPTY; PULSES]; 2],
        }
    }

    /// Borrow the two stores.
    pub(super) fn split(&mut self) -> [Store<'_, S>; 2] {
        let Self {
            samples: [a, b],
            pulses: [first, second],
        } = self;
        [
            Store::new(a.as_flattened_mut(), first),
            Store::new(b.as_flattened_mut(), second),
        ]
    }
}

impl<S: Sample, const PULSES: usize, const FREQUENCIES: usize> Default
    for PulseStores<S, PULSES, FREQUENCIES>
{
    fn default() -> Self {
        Self::new()
    }
}
