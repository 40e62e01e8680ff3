//! Stream processor: collects pulses into sub-CPIs, forms maps, and recovers from missing pulses.

use core::fmt;

use super::engine::{Engine, Work};
use super::sample::Sample;
use super::stores::{Store, row_of};
use super::{
    Capacity, MapHeader, MapSamples, Patch, PatchMap, PulseCounters, Quantity, Setup, SetupError,
    nodes,
};
use crate::{LengthError, Pulse};

/// Reason why a pulse was not stored. The pulse is counted in [`PulseCounters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PulseError {
    /// No run is active: call [`SubCpiProcessor::start`] first.
    NotRunning,
    /// The number of samples differs from the frequencies of the setup.
    Length,
    /// A position, weight or sample is not finite.
    NotFinite,
    /// A pulse of this number or a later one was received before.
    Repeated,
    /// The pulse number is `u32::MAX`, which is reserved so that a next pulse number exists.
    Number,
    /// Both stores are full. The pulse's sub-CPI will be discarded as incomplete.
    Full,
    /// The first pulse of the sub-CPI is missing. Storage resumes with the next sub-CPI.
    Waiting,
}

impl fmt::Display for PulseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotRunning => "no run is active: start one before pushing pulses",
            Self::Length => "number of samples differs from the frequencies of the setup",
            Self::NotFinite => "a position, weight or sample is not finite",
            Self::Repeated => "a pulse of this number or a later one was received before",
            Self::Number => "pulse number 4294967295 is reserved: expected a smaller one",
            Self::Full => "both pulse stores are full: call work() until a store is free",
            Self::Waiting => "first pulse of the sub-CPI is missing: waiting for the next sub-CPI",
        })
    }
}

impl core::error::Error for PulseError {}

/// Result of one call of [`SubCpiProcessor::work`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// No sub-CPI is complete; nothing was done.
    Idle,
    /// One step was done; the map is not complete yet.
    Busy,
    /// A map is complete: read it with [`SubCpiProcessor::map`]. The next call of `work` discards it.
    Map,
}

/// Next step of the sub-CPI being processed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Begin,
    Column(usize),
    Row(usize),
    Ready,
}

/// Streaming sub-CPI processor: stores pulses and forms the maps of every patch in steps of bounded duration.
///
/// Pulses carry consecutive numbers below `u32::MAX`. Sub-CPI `n` of a run holds the pulses `n M C .. (n + 1) M C` of `C`
/// channels, which take turns. A sub-CPI with a missing pulse is discarded; the next one is unaffected. Maps come patch by
/// patch, and within a patch channel by channel.
#[derive(Debug)]
pub struct SubCpiProcessor<'a, E: Engine> {
    engine: E,
    capacity: Capacity,
    setup: Option<Setup>,
    weights: &'a mut [f32],
    patches: &'a mut [Patch],
    num_patches: usize,
    stores: [Store<'a, E::Sample>; 2],
    /// Index of the store being filled. The other store is being processed or is free.
    filling: usize,
    running: bool,
    next_pulse: u32,
    /// Index of the patch being processed, and of its channel.
    patch: usize,
    channel: usize,
    stage: Stage,
    /// Header of the completed map.
    header: Option<MapHeader>,
    counters: PulseCounters,
    /// Saturation count of the engine at the start of the run.
    saturated_before: u32,
}

impl<'a, E: Engine> SubCpiProcessor<'a, E>
where
    E::Sample: Sample,
{
    /// Create a processor on borrowed buffers: fast-time weights (one per frequency), patches, two pulse stores and an
    /// engine with its own buffers.
    ///
    /// # Errors
    /// [`LengthError`] naming the first buffer that is shorter than `capacity` requires. On a short store a pulse
    /// would be stored in part or not at all.
    ///
    /// ```
    /// use subaperture_core::stream::{Capacity, FloatEngine, Patch, PulsePhase, Store, SubCpiProcessor};
    /// use subaperture_core::{Complex32, Pulse};
    /// let capacity = Capacity { pulses: 2, frequencies: 4, range_bins: 4, doppler_bins: 1, patches: 1 };
    /// let (mut map, mut row, mut column) = ([Complex32::ZERO; 4], [Complex32::ZERO; 4], [Complex32::ZERO; 2]);
    /// let mut phases = [PulsePhase::EMPTY; 2];
    /// let (mut weights, mut patches) = ([0.0; 4], [Patch::EMPTY; 1]);
    /// // The second store has room for 7 samples; 2 pulses of 4 frequencies need 8.
    /// let (mut first, mut second) = ([Complex32::ZERO; 8], [Complex32::ZERO; 7]);
    /// let (mut early, mut late) = ([Pulse::EMPTY; 2], [Pulse::EMPTY; 2]);
    /// let engine = FloatEngine::new(&mut map, &mut row, &mut column, &mut phases);
    /// let stores = [Store::new(&mut first, &mut early), Store::new(&mut second, &mut late)];
    /// let error = SubCpiProcessor::from_parts(engine, capacity, &mut weights, &mut patches, stores).unwrap_err();
    /// assert_eq!(error.to_string(), "pulse store samples: expected 8 elements, found 7");
    /// ```
    pub fn from_parts(
        engine: E,
        capacity: Capacity,
        weights: &'a mut [f32],
        patches: &'a mut [Patch],
        stores: [Store<'a, E::Sample>; 2],
    ) -> Result<Self, LengthError> {
        let (pulses, frequencies) = (
            usize::from(capacity.pulses),
            usize::from(capacity.frequencies),
        );
        LengthError::at_least("weights", frequencies, weights.len())?;
        LengthError::at_least("patches", capacity.patches.into(), patches.len())?;
        for store in &stores {
            let samples = pulses.saturating_mul(frequencies);
            LengthError::at_least("pulse store samples", samples, store.samples.len())?;
            LengthError::at_least("pulse store headers", pulses, store.pulses.len())?;
        }
        engine.holds(&capacity)?;
        Ok(Self::with_buffers(
            engine, capacity, weights, patches, stores,
        ))
    }

    /// Create a processor on buffers whose lengths match `capacity`.
    pub(super) fn with_buffers(
        engine: E,
        capacity: Capacity,
        weights: &'a mut [f32],
        patches: &'a mut [Patch],
        stores: [Store<'a, E::Sample>; 2],
    ) -> Self {
        Self {
            engine,
            capacity,
            setup: None,
            weights,
            patches,
            num_patches: 0,
            stores,
            filling: 0,
            running: false,
            next_pulse: 0,
            patch: 0,
            channel: 0,
            stage: Stage::Begin,
            header: None,
            counters: PulseCounters::default(),
            saturated_before: 0,
        }
    }

    /// Maximum sizes that the buffers hold.
    pub fn capacity(&self) -> &Capacity {
        &self.capacity
    }

    /// Settings of the run, or `None` before [`SubCpiProcessor::configure`].
    pub fn setup(&self) -> Option<&Setup> {
        self.setup.as_ref()
    }

    /// Settings, or an error that asks for a number of pulses if there are none.
    fn settings(&self) -> Result<Setup, SetupError> {
        self.setup.ok_or(SetupError::Size {
            what: Quantity::Pulses,
            wanted: 0,
            most: self.capacity.pulses.into(),
        })
    }

    /// Set the settings of the next run. Resets the fast-time window to rectangular, clears the patch list and ends the
    /// current run.
    ///
    /// # Errors
    /// [`SetupError`] if a size or value is invalid. The processor is then unchanged.
    pub fn configure(&mut self, setup: &Setup) -> Result<(), SetupError> {
        setup.check(&self.capacity)?;
        self.stop();
        self.setup = Some(*setup);
        self.num_patches = 0;
        self.weights.fill(1.0 / f32::from(setup.num_frequencies));
        Ok(())
    }

    /// Set fast-time window weights starting at frequency `first`. All weights together should sum to 1. Ends the run.
    ///
    /// # Errors
    /// [`SetupError`] if the weights exceed the number of frequencies, a weight is not finite, or no setup is set.
    pub fn set_weights(
        &mut self,
        first: usize,
        weights: impl ExactSizeIterator<Item = f32> + Clone,
    ) -> Result<(), SetupError> {
        let frequencies = usize::from(self.settings()?.num_frequencies);
        let end = first.saturating_add(weights.len());
        if end > frequencies {
            return Err(SetupError::Size {
                what: Quantity::Weights,
                wanted: end as u32,
                most: frequencies as u32,
            });
        }
        if !weights.clone().all(f32::is_finite) {
            return Err(SetupError::NotFinite);
        }
        self.stop();
        for (place, weight) in self.weights.iter_mut().skip(first).zip(weights) {
            *place = weight;
        }
        Ok(())
    }

    /// Set patch `index` and truncate the list after it. Ends the run.
    ///
    /// # Errors
    /// [`SetupError`] if `index` is beyond the end of the list or the capacity, the patch does not fit the setup, or no
    /// setup is set.
    pub fn set_patch(&mut self, index: usize, patch: &Patch) -> Result<(), SetupError> {
        let setup = self.settings()?;
        setup.check_patch(patch, &self.capacity)?;
        let most = (self.num_patches + 1).min(self.patches.len());
        if index >= most {
            return Err(SetupError::Size {
                what: Quantity::Patches,
                wanted: (index as u32).saturating_add(1),
                most: most as u32,
            });
        }
        self.stop();
        if let Some(place) = self.patches.get_mut(index) {
            *place = *patch;
        }
        self.num_patches = index + 1;
        Ok(())
    }

    /// Patch list.
    pub fn patches(&self) -> &[Patch] {
        self.patches.get(..self.num_patches).unwrap_or(&[])
    }

    /// Start a run with pulse number `first` and reset the counters.
    ///
    /// # Errors
    /// [`SetupError`] if no setup or no patch is set.
    pub fn start(&mut self, first: u32) -> Result<(), SetupError> {
        self.settings()?;
        if self.num_patches == 0 {
            return Err(SetupError::Size {
                what: Quantity::Patches,
                wanted: 0,
                most: u32::from(self.capacity.patches),
            });
        }
        self.stop();
        self.running = true;
        self.next_pulse = first;
        self.counters = PulseCounters::default();
        self.saturated_before = self.engine.saturated();
        Ok(())
    }

    /// Stop the run and discard all stored pulses and the map in progress.
    pub fn stop(&mut self) {
        self.running = false;
        self.stores.iter_mut().for_each(Store::clear);
        self.filling = 0;
        self.patch = 0;
        self.channel = 0;
        self.stage = Stage::Begin;
    }

    /// Whether a complete sub-CPI is waiting or being processed.
    pub fn is_working(&self) -> bool {
        self.stores.iter().any(|store| store.full)
    }

    /// Number of the next expected pulse.
    pub fn next_pulse(&self) -> u32 {
        self.next_pulse
    }

    /// Flow-control limit: pulses with numbers below this value can be stored now. It covers the rest of the current
    /// sub-CPI and the next one as far as stores are free. 0 if no run is active.
    pub fn accept_through(&self) -> u32 {
        let Some(setup) = self.setup.filter(|_| self.running) else {
            return 0;
        };
        let num_pulses = setup.numbers_per_sub_cpi().max(1);
        let free = self.stores.iter().filter(|store| !store.full).count() as u32;
        let begun = self.next_pulse - self.next_pulse % num_pulses;
        match free {
            0 => self.next_pulse,
            free => begun.saturating_add(free * num_pulses),
        }
    }

    /// Pulse counters of the current run.
    pub fn counters(&self) -> PulseCounters {
        // The engine counts from its construction, not from the start of the run.
        let saturated = self.engine.saturated();
        PulseCounters {
            saturated: saturated.saturating_sub(self.saturated_before),
            ..self.counters
        }
    }

    /// Store one pulse with its samples.
    ///
    /// # Errors
    /// [`PulseError`] states why the pulse was not stored.
    pub fn push(
        &mut self,
        pulse: &Pulse,
        samples: impl ExactSizeIterator<Item = E::Sample> + Clone,
    ) -> Result<(), PulseError> {
        let Some(setup) = self.setup.filter(|_| self.running) else {
            return Err(PulseError::NotRunning);
        };
        if pulse.number < self.next_pulse {
            self.counters.repeated = self.counters.repeated.saturating_add(1);
            return Err(PulseError::Repeated);
        }
        let Some(next_pulse) = pulse.number.checked_add(1) else {
            self.counters.refused = self.counters.refused.saturating_add(1);
            return Err(PulseError::Number);
        };
        let frequencies = usize::from(setup.num_frequencies);
        let finite = [pulse.reference_path_m, pulse.time_s, pulse.weight.into()]
            .iter()
            .chain(&pulse.transmitter_m)
            .chain(&pulse.receiver_m)
            .all(|value| value.is_finite());
        let usable = if samples.len() != frequencies {
            Err(PulseError::Length)
        } else if !finite || !samples.clone().all(Sample::is_finite) {
            Err(PulseError::NotFinite)
        } else {
            Ok(())
        };
        let place = (pulse.number % setup.numbers_per_sub_cpi().max(1)) as usize;
        let missing = pulse.number - self.next_pulse;
        self.next_pulse = next_pulse;
        self.counters.lost = self.counters.lost.saturating_add(missing);
        if let Err(error) = usable {
            // The refused pulse leaves a gap, so its sub-CPI is discarded at the next pulse.
            self.counters.refused = self.counters.refused.saturating_add(1);
            return Err(error);
        }

        let Some(store) = self.stores.get_mut(self.filling) else {
            return Err(PulseError::Full);
        };
        if store.full {
            self.counters.dropped = self.counters.dropped.saturating_add(1);
            return Err(PulseError::Full);
        }
        // Compare numbers, not places: a gap of a whole number of sub-CPIs leads to the same place.
        let follows = match store.last_pulse(&setup) {
            Some(last) => last.number.wrapping_add(1) == pulse.number,
            None => place == 0,
        };
        if !follows {
            if store.count > 0 {
                self.counters.incomplete = self.counters.incomplete.saturating_add(1);
                store.clear();
            }
            if place != 0 {
                self.counters.dropped = self.counters.dropped.saturating_add(1);
                return Err(PulseError::Waiting);
            }
        }
        let index = row_of(&setup, place);
        let first = index * frequencies;
        let row = store.samples.get_mut(first..first + frequencies);
        let (Some(row), Some(kept)) = (row, store.pulses.get_mut(index)) else {
            // Unreachable: store lengths were checked against the capacity, which bounds the setup.
            self.counters.dropped = self.counters.dropped.saturating_add(1);
            return Err(PulseError::Full);
        };
        let mut at_limit = 0u32;
        for (out, sample) in row.iter_mut().zip(samples) {
            *out = sample;
            at_limit += u32::from(sample.at_limit());
        }
        *kept = *pulse;
        store.count = place + 1;
        self.counters.accepted = self.counters.accepted.saturating_add(1);
        self.counters.at_limit = self.counters.at_limit.saturating_add(at_limit);
        if store.count as u32 == setup.numbers_per_sub_cpi() {
            self.switch_stores();
        }
        Ok(())
    }

    /// End the input. A partly filled sub-CPI is processed as one of fewer pulses unless a pulse after its last one
    /// or a channel of that one is missing.
    pub fn finish(&mut self) {
        self.running = false;
        let (Some(setup), Some(store)) = (&self.setup, self.stores.get_mut(self.filling)) else {
            return;
        };
        let Some(last) = store.last_pulse(setup).filter(|_| !store.full) else {
            return;
        };
        let follows = last.number.wrapping_add(1) == self.next_pulse;
        if follows && store.count.is_multiple_of(setup.num_channels.into()) {
            self.switch_stores();
        } else {
            self.counters.incomplete = self.counters.incomplete.saturating_add(1);
            store.clear();
        }
    }

    /// Mark the filling store as full and switch to the other.
    fn switch_stores(&mut self) {
        if let Some(store) = self.stores.get_mut(self.filling) {
            store.full = true;
        }
        self.filling = 1 - self.filling.min(1);
    }

    /// Store to process: the older of two full ones, which is the next to be filled.
    fn working(&self) -> Option<usize> {
        let full = |index: usize| self.stores.get(index).is_some_and(|store| store.full);
        let filling = self.filling;
        [filling, 1 - filling.min(1)].into_iter().find(|&i| full(i))
    }

    /// Do one step: prepare a patch, or process one frequency or one Doppler bin of it.
    pub fn work(&mut self) -> Progress {
        let Some((setup, index)) = self.setup.zip(self.working()) else {
            return Progress::Idle;
        };
        if self.stage == Stage::Ready {
            self.stage = Stage::Begin;
            self.channel += 1;
            if self.channel >= usize::from(setup.num_channels) {
                self.channel = 0;
                self.patch += 1;
            }
            if self.patch >= self.num_patches {
                self.patch = 0;
                if let Some(store) = self.stores.get_mut(index) {
                    store.clear();
                }
            }
            return Progress::Busy;
        }
        let Some(work) = work(
            &setup,
            self.patches.get(self.patch),
            self.weights,
            self.stores.get(index),
            self.channel,
        ) else {
            return Progress::Idle;
        };
        self.stage = match self.stage {
            Stage::Begin => {
                self.engine.begin(&work);
                Stage::Column(0)
            }
            Stage::Column(k) => {
                self.engine.column(&work, k);
                if k + 1 < usize::from(setup.num_frequencies) {
                    Stage::Column(k + 1)
                } else {
                    Stage::Row(0)
                }
            }
            Stage::Row(row) => {
                self.engine.row(&work, row);
                if row + 1 < work.patch.num_doppler_bins() {
                    Stage::Row(row + 1)
                } else {
                    Stage::Ready
                }
            }
            Stage::Ready => Stage::Ready,
        };
        if self.stage != Stage::Ready {
            return Progress::Busy;
        }
        self.header = map_header(&work, self.patch, self.channel);
        Progress::Map
    }

    /// Completed map, available until the next call of [`SubCpiProcessor::work`].
    pub fn map(&self) -> Option<PatchMap<'_>> {
        if self.stage != Stage::Ready {
            return None;
        }
        let setup = self.setup.as_ref()?;
        let store = self.stores.get(self.working()?);
        let patch = self.patches.get(self.patch);
        let work = work(setup, patch, self.weights, store, self.channel)?;
        let samples: MapSamples<'_> = self.engine.map(&work);
        Some(PatchMap {
            header: self.header?,
            samples,
        })
    }
}

/// Header of the map of a sub-CPI, a patch and a channel.
fn map_header<S>(work: &Work<'_, S>, patch: usize, channel: usize) -> Option<MapHeader> {
    let (first, last) = (work.pulses.first()?, work.pulses.last()?);
    Some(MapHeader {
        sub_cpi: first.number / work.setup.numbers_per_sub_cpi().max(1),
        patch_index: patch as u16,
        channel: channel as u16,
        num_pulses: work.pulses.len() as u16,
        patch: *work.patch,
        time_s: [first.time_s, last.time_s],
        weight_sum: work.pulses.iter().map(|pulse| pulse.weight).sum(),
        nodes: nodes(work.pulses),
    })
}

/// Borrow the engine's input from the parts of a processor.
fn work<'w, S>(
    setup: &'w Setup,
    patch: Option<&'w Patch>,
    weights: &'w [f32],
    store: Option<&'w Store<'_, S>>,
    channel: usize,
) -> Option<Work<'w, S>> {
    let (store, frequencies) = (store?, usize::from(setup.num_frequencies));
    let first = channel * usize::from(setup.num_pulses);
    let end = first + store.count.checked_div(setup.num_channels.into())?;
    Some(Work {
        setup,
        patch: patch?,
        weights: weights.get(..usize::from(setup.num_frequencies))?,
        pulses: store.pulses.get(first..end)?,
        samples: store.samples.get(first * frequencies..end * frequencies)?,
    })
}
