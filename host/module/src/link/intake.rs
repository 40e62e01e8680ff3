//! Acceptance of received products, and list of missing ones.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;

use subaperture_core::link::{ChipAssembly, Encoding, MapAssembly, Report, row_bytes};

use super::counts::Counts;
use super::ending::LinkError;
use super::job::Wanted;
use super::products::{AccumulatedImage, ChannelDetection, DetectionAssembly, Products};

/// Reassembles products and passes the requested ones to their receiver, once each.
///
/// The unit of account is the map: one per sub-CPI and patch. A map counts as taken once it was received, its detections were
/// received, or the module reports its sub-CPI as accumulated.
pub(super) struct Intake<'c> {
    assembly: Assembly<'c>,
    wanted: Wanted<'c>,
    taken: BTreeSet<(u32, u16)>,
    products: Products<'c>,
    /// Whether received products belong to the current run.
    listening: bool,
    /// Whether the current runs repeat what earlier ones lost.
    again: bool,
}

/// Reassembly of the requested products.
enum Assembly<'c> {
    Maps(MapAssembly<'c>),
    Detections(DetectionAssembly),
    Chips(ChipAssembly<'c>),
}

impl<'c> Intake<'c> {
    /// Size in bytes of the largest map in either encoding, or of the largest chip.
    pub(super) fn room_bytes(wanted: &Wanted<'_>, products: &Products<'_>) -> usize {
        let maps = wanted.patches.iter().flat_map(|patch| {
            [Encoding::Complex32, Encoding::Sc16].map(|encoding| {
                row_bytes(encoding, patch.num_range_bins()).unwrap_or(0) * patch.num_doppler_bins()
            })
        });
        match products {
            Products::Maps(_) => maps.max().unwrap_or(0),
            Products::Detections(..) => 0,
            Products::Image(request, _) => {
                let chips = request.chips.iter().map(|grid| 8 * grid.num_pixels());
                chips.max().unwrap_or(0)
            }
        }
    }

    pub(super) fn new(
        wanted: Wanted<'c>,
        buffer: &'c mut [u8],
        mut products: Products<'c>,
    ) -> Self {
        let assembly = match &mut products {
            Products::Maps(_) => Assembly::Maps(MapAssembly::new(buffer)),
            Products::Detections(..) => Assembly::Detections(DetectionAssembly::default()),
            Products::Image(request, image) => {
                image.reset(request.chips.len());
                Assembly::Chips(ChipAssembly::new(buffer))
            }
        };
        Self {
            assembly,
            wanted,
            taken: BTreeSet::new(),
            products,
            listening: false,
            again: false,
        }
    }

    /// Whether the module accumulates an image.
    pub(super) fn is_image(&self) -> bool {
        matches!(self.products, Products::Image(..))
    }

    /// Process a report. A requested product that it completes goes to its receiver.
    pub(super) fn take(
        &mut self,
        report: &Report<'_>,
        counts: &mut Counts,
    ) -> Result<(), LinkError> {
        if !self.listening && !self.is_image() {
            return Ok(());
        }
        // The assemblies count losses.
        let key = match (&mut self.assembly, &mut self.products) {
            (Assembly::Maps(assembly), Products::Maps(sink)) => {
                let Ok(Some(map)) = assembly.take(report) else {
                    return Ok(());
                };
                let key = (map.header.sub_cpi, map.header.patch_index);
                if !self.wanted.asks_for(&map.header) {
                    counts.maps_refused += 1;
                    return Ok(());
                }
                if !self.taken.contains(&key) {
                    sink.accept(&map).map_err(LinkError::Sink)?;
                }
                key
            }
            (Assembly::Detections(assembly), Products::Detections(_, sink)) => {
                let Some((sub_cpi, patch, list)) = assembly.take(report) else {
                    return Ok(());
                };
                let key = (sub_cpi, patch);
                let other =
                    |found: &ChannelDetection| found.values.len() != self.wanted.num_channels;
                if !self.wanted.has(key) || list.iter().any(other) {
                    counts.maps_refused += 1;
                    return Ok(());
                }
                if !self.taken.contains(&key) {
                    sink.accept(sub_cpi, patch, list).map_err(LinkError::Sink)?;
                }
                key
            }
            (Assembly::Chips(assembly), Products::Image(request, image)) => {
                if let Ok(Some(chip)) = assembly.take(report) {
                    image.accept(*request, &chip);
                }
                return Ok(());
            }
            _ => return Ok(()),
        };
        self.count(key, counts);
        Ok(())
    }

    /// Count a map as taken.
    fn count(&mut self, key: (u32, u16), counts: &mut Counts) {
        if self.taken.insert(key) {
            counts.maps_taken += 1;
            counts.maps_fetched_again += u64::from(self.again);
        } else {
            counts.maps_repeated += 1;
        }
    }

    /// Process a part of the module's list of accumulated sub-CPIs. Returns the first sub-CPI of the next part, or `None` at the
    /// end of the list.
    ///
    /// # Errors
    /// [`LinkError::Restarted`] if the list lacks a sub-CPI that it had before.
    pub(super) fn take_accumulated(
        &mut self,
        first: u32,
        bits: &[u8],
        counts: &mut Counts,
    ) -> Result<Option<u32>, LinkError> {
        let end = first.saturating_add(8 * bits.len() as u32);
        let end = end.min(self.wanted.num_sub_cpis());
        for sub_cpi in first..end {
            let offset = sub_cpi - first;
            let has = bits[offset as usize / 8] >> (offset % 8) & 1 == 1;
            let had = self.taken.contains(&(sub_cpi, 0));
            if had && !has {
                return Err(LinkError::Restarted);
            }
            if has && !had {
                for patch in 0..self.wanted.patches.len() as u16 {
                    self.count((sub_cpi, patch), counts);
                }
                if let Products::Image(_, image) = &mut self.products {
                    image.sub_cpis.push(sub_cpi);
                }
            }
        }
        // A list that is too short belongs to no image.
        if bits.is_empty() {
            return Err(LinkError::Restarted);
        }
        Ok((end < self.wanted.num_sub_cpis()).then_some(end))
    }

    /// Next chip to request.
    pub(super) fn next_chip(&self) -> Option<u16> {
        match &self.products {
            Products::Image(_, image) if !image.sub_cpis.is_empty() => image.next_chip(),
            _ => None,
        }
    }

    /// Take the received image as a preview.
    pub(super) fn take_preview(&mut self) -> Option<AccumulatedImage> {
        match &mut self.products {
            Products::Image(_, image) => Some(image.take_preview()),
            _ => None,
        }
    }

    /// Forget an accumulated image: the module has lost it.
    pub(super) fn reset_image(&mut self, counts: &mut Counts) {
        if let (Assembly::Chips(assembly), Products::Image(request, image)) =
            (&mut self.assembly, &mut self.products)
        {
            assembly.restart();
            image.reset(request.chips.len());
            counts.maps_taken -= self.taken.len() as u64;
            self.taken.clear();
        }
    }

    /// Set whether the following runs repeat what earlier ones lost.
    pub(super) fn fetch_again(&mut self, again: bool) {
        self.again = again;
    }

    /// Start a run: forget incomplete maps.
    pub(super) fn begin(&mut self) {
        match &mut self.assembly {
            Assembly::Maps(assembly) => assembly.restart(),
            Assembly::Detections(assembly) => assembly.restart(),
            Assembly::Chips(_) => {}
        }
        self.listening = true;
    }

    /// End a run, finished or interrupted.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        self.listening = false;
        counts.maps_lost += u64::from(match &self.assembly {
            Assembly::Maps(assembly) => assembly.lost(),
            Assembly::Detections(assembly) => assembly.lost(),
            Assembly::Chips(_) => 0,
        });
    }

    /// Set the number of maps that the module reports for the run.
    pub(super) fn made(&mut self, maps: u32) {
        match &mut self.assembly {
            Assembly::Maps(assembly) => assembly.finish(maps),
            Assembly::Detections(assembly) => assembly.finish(maps),
            Assembly::Chips(_) => {}
        }
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
