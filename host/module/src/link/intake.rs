//! Acceptance of received maps, and list of missing ones.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;

use subaperture_core::link::{AssembledMap, Encoding, MapAssembly, Report, row_bytes};

use super::counts::Counts;
use super::ending::{LinkError, SinkError};
use super::job::Wanted;

/// Receiver of complete maps.
pub trait MapSink {
    /// Accept a complete, requested map. Every map is passed once, in any order.
    ///
    /// # Errors
    /// An error ends the transfer.
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError>;
}

/// Sink that discards maps, for a conversation that only identifies the module.
pub(super) struct DiscardMaps;

impl MapSink for DiscardMaps {
    fn accept(&mut self, _: &AssembledMap<'_>) -> Result<(), SinkError> {
        Ok(())
    }
}

/// Reassembles maps and passes the requested ones to a sink, once each.
pub(super) struct Intake<'c> {
    assembly: MapAssembly<'c>,
    wanted: Wanted<'c>,
    taken: BTreeSet<(u32, u16)>,
    sink: &'c mut dyn MapSink,
    /// Whether received maps belong to the current run.
    listening: bool,
    /// Whether the current runs repeat what earlier ones lost.
    again: bool,
}

impl<'c> Intake<'c> {
    /// Size in bytes of the largest map in either encoding.
    pub(super) fn room_bytes(wanted: &Wanted<'_>) -> usize {
        let bytes = wanted.patches.iter().flat_map(|patch| {
            [Encoding::Complex32, Encoding::Sc16].map(|encoding| {
                row_bytes(encoding, patch.num_range_bins()).unwrap_or(0) * patch.num_doppler_bins()
            })
        });
        bytes.max().unwrap_or(0)
    }

    pub(super) fn new(wanted: Wanted<'c>, buffer: &'c mut [u8], sink: &'c mut dyn MapSink) -> Self {
        Self {
            assembly: MapAssembly::new(buffer),
            wanted,
            taken: BTreeSet::new(),
            sink,
            listening: false,
            again: false,
        }
    }

    /// Process a report. A requested map that it completes goes to the sink.
    pub(super) fn take(
        &mut self,
        report: &Report<'_>,
        counts: &mut Counts,
    ) -> Result<(), LinkError> {
        if !self.listening {
            return Ok(());
        }
        // The assembly counts losses.
        let Ok(Some(map)) = self.assembly.take(report) else {
            return Ok(());
        };
        let key = (map.header.sub_cpi, map.header.patch_index);
        if !self.wanted.asks_for(&map.header) {
            counts.maps_refused += 1;
        } else if self.taken.contains(&key) {
            counts.maps_repeated += 1;
        } else {
            self.sink.accept(&map).map_err(LinkError::Sink)?;
            self.taken.insert(key);
            counts.maps_taken += 1;
            counts.maps_fetched_again += u64::from(self.again);
        }
        Ok(())
    }

    /// Set whether the following runs repeat what earlier ones lost.
    pub(super) fn fetch_again(&mut self, again: bool) {
        self.again = again;
    }

    /// Start a run: forget incomplete maps.
    pub(super) fn begin(&mut self) {
        self.assembly.restart();
        self.listening = true;
    }

    /// End a run, finished or interrupted.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        self.listening = false;
        counts.maps_lost += u64::from(self.assembly.lost());
    }

    /// Set the number of maps that the module reports for the run.
    pub(super) fn made(&mut self, maps: u32) {
        self.assembly.finish(maps);
    }

    /// Expected maps.
    pub(super) fn wanted(&self) -> &Wanted<'c> {
        &self.wanted
    }

    fn has_all(&self, sub_cpi: u32) -> bool {
        let patches = self.wanted.patches.len();
        self.taken.range((sub_cpi, 0)..=(sub_cpi, u16::MAX)).count() == patches
    }

    /// Ranges of sub-CPIs within `range` with a missing map.
    pub(super) fn missing(&self, range: Range<u32>) -> VecDeque<Range<u32>> {
        let mut runs: VecDeque<Range<u32>> = VecDeque::new();
        for sub_cpi in range.filter(|&sub_cpi| !self.has_all(sub_cpi)) {
            match runs.back_mut() {
                Some(run) if run.end == sub_cpi => run.end += 1,
                _ => runs.push_back(sub_cpi..sub_cpi + 1),
            }
        }
        runs
    }

    /// Sub-CPI and patch of every missing map.
    pub(super) fn missing_maps(&self) -> Vec<(u32, u16)> {
        let patches = 0..self.wanted.patches.len() as u16;
        (0..self.wanted.num_sub_cpis())
            .flat_map(|sub_cpi| patches.clone().map(move |patch| (sub_cpi, patch)))
            .filter(|key| !self.taken.contains(key))
            .collect()
    }
}
