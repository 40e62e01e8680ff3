//! Where raw pulses wait.

use super::Sample;
use crate::Pulse;

/// Raw pulses of one sub-CPI.
#[derive(Debug)]
pub struct Store<'a, S> {
    pub(super) samples: &'a mut [S],
    pub(super) pulses: &'a mut [Pulse],
    /// Pulses that are there.
    pub(super) count: usize,
    /// Whether it waits for work, or is in work.
    pub(super) full: bool,
}

impl<'a, S> Store<'a, S> {
    /// Lends the buffers: samples of `M F`, pulses of `M`, at the most that the capacity states.
    pub fn new(samples: &'a mut [S], pulses: &'a mut [Pulse]) -> Self {
        Self {
            samples,
            pulses,
            count: 0,
            full: false,
        }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.full = false;
    }
}

/// Two stores of raw pulses of samples `S`.
#[derive(Debug)]
pub struct PulseStores<S, const PULSES: usize, const FREQUENCIES: usize> {
    samples: [[[S; FREQUENCIES]; PULSES]; 2],
    pulses: [[Pulse; PULSES]; 2],
}

impl<S: Sample, const PULSES: usize, const FREQUENCIES: usize> PulseStores<S, PULSES, FREQUENCIES> {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Empty stores, all zero bytes.
    pub const fn new() -> Self {
        const {
            assert!(
                PULSES >= 1 && PULSES <= 4096 && FREQUENCIES >= 1 && FREQUENCIES <= 4096,
                "PULSES and FREQUENCIES are 1 to 4096"
            );
        };
        Self {
            samples: [[[S::ZERO; FREQUENCIES]; PULSES]; 2],
            pulses: [[Pulse::EMPTY; PULSES]; 2],
        }
    }

    /// Lends the stores.
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
