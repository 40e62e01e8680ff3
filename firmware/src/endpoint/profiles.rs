//! Profiler and state of runs that produce range profiles.

use subaperture_core::link::ProfileHeader;
use subaperture_core::stream::PulseCounters;
use subaperture_core::sweep::{BurstError, Setup};

use crate::profiler::WireProfiler;

/// Profiler and state of a range-profile run.
#[derive(Default)]
pub(super) struct Profiles<'a> {
    pub(super) profiler: Option<&'a mut dyn WireProfiler>,
    /// Setup, if the current configuration is a range-profile configuration, and number of weights received.
    pub(super) setup: Option<Setup>,
    pub(super) weights: usize,
    /// Sweep whose profile was requested.
    pub(super) requested: Option<u32>,
    pub(super) counters: PulseCounters,
}

impl<'a> Profiles<'a> {
    /// Create the state with a profiler.
    pub(super) fn with(profiler: &'a mut dyn WireProfiler) -> Self {
        Self {
            profiler: Some(profiler),
            ..Self::default()
        }
    }

    /// Whether the current configuration produces range profiles.
    pub(super) fn is_configured(&self) -> bool {
        self.setup.is_some()
    }

    /// Disable range profiles.
    pub(super) fn clear(&mut self) {
        self.setup = None;
        self.requested = None;
    }

    /// Number of the current or next expected sweep.
    pub(super) fn next_sweep(&self) -> u32 {
        self.profiler.as_ref().map_or(0, |own| own.sweep())
    }

    /// Counters of the run's burst messages.
    pub(super) fn counters(&self) -> PulseCounters {
        let incomplete = self.profiler.as_ref().map_or(0, |own| own.left_out());
        PulseCounters {
            incomplete,
            ..self.counters
        }
    }

    /// Count a burst message.
    pub(super) fn count(&mut self, taken: Result<(), BurstError>) {
        let counters = &mut self.counters;
        let counter = match taken {
            Ok(()) => &mut counters.accepted,
            Err(BurstError::NotStarted) => &mut counters.dropped,
            Err(BurstError::Repeated) => &mut counters.repeated,
            Err(BurstError::Carrier | BurstError::Length) => &mut counters.refused,
        };
        *counter = counter.saturating_add(1);
    }

    /// Header of the available profile, with rows that fit a buffer of `row_bytes` bytes.
    pub(super) fn header(&self, row_bytes: usize) -> Option<ProfileHeader> {
        let profile = self.profiler.as_ref()?.profile()?;
        let bins = profile.values.len();
        // Powers of two divide each other.
        let room = (row_bytes / 8).checked_ilog2().map_or(0, |log| 1 << log);
        Some(ProfileHeader {
            sweep: profile.sweep,
            usable: profile.usable,
            taken: profile.taken,
            bins: bins as u16,
            row_bins: bins.min(room) as u16,
        })
    }
}
