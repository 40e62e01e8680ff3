//! Pulses in, maps out: the order of things, and what happens when it is disturbed.

use super::engine::{Engine, Work};
use super::sample::Sample;
use super::stores::Store;
use super::{
    Capacity, MapHeader, MapSamples, Patch, PatchMap, PulseCounters, Quantity, Setup, SetupError,
    nodes,
};
use crate::Pulse;

/// Why a pulse was not stored. It has been counted; nothing else has changed but what is said here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseError {
    /// Nothing is running.
    NotRunning,
    /// The pulse has too few or too many samples.
    Length,
    /// A position, a weight or a sample is not a finite number.
    NotFinite,
    /// Its number was there before.
    Repeated,
    /// Its number is the largest that there is: none could be due after it.
    Number,
    /// Both stores are full. Its sub-CPI will be given up.
    Full,
    /// The beginning of its sub-CPI is missing: it waits for the next.
    Waiting,
}

/// What [`SubCpiProcessor::work`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nothing: no sub-CPI is full.
    Idle,
    /// A part of a map.
    Busy,
    /// A map is ready: [`SubCpiProcessor::map`]. Going on with the work gives it up.
    Map,
}

/// What is due next of the sub-CPI in work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Begin,
    Column(usize),
    Row(usize),
    Ready,
}

/// Collects pulses into sub-CPIs and forms the maps of every patch, a bounded piece of work at a time.
///
/// Pulses carry running numbers, below the largest `u32`; sub-CPI `n` holds the pulses `n M .. (n + 1) M`
/// of a run. A sub-CPI that misses a pulse is given up, and the next one is right.
#[derive(Debug)]
pub struct SubCpiProcessor<'a, E: Engine> {
    engine: E,
    capacity: Capacity,
    setup: Option<Setup>,
    weights: &'a mut [f32],
    patches: &'a mut [Patch],
    num_patches: usize,
    stores: [Store<'a, E::Sample>; 2],
    /// The store that fills; the other one is worked on, or free.
    filling: usize,
    running: bool,
    next_pulse: u32,
    /// The index of the patch in work.
    patch: usize,
    stage: Stage,
    counters: PulseCounters,
    /// What the engine had clamped when the run began.
    saturated_before: u32,
}

impl<'a, E: Engine> SubCpiProcessor<'a, E>
where
    E::Sample: Sample,
{
    /// Lends the buffers, whose sizes must be those that `capacity` states: weights one a frequency.
    pub fn from_parts(
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
            stage: Stage::Begin,
            counters: PulseCounters::default(),
            saturated_before: 0,
        }
    }

    /// The sizes that there is room for.
    pub fn capacity(&self) -> &Capacity {
        &self.capacity
    }

    /// The settings, if any.
    pub fn setup(&self) -> Option<&Setup> {
        self.setup.as_ref()
    }

    /// The settings; without, sub-CPIs are of no pulses.
    fn settings(&self) -> Result<Setup, SetupError> {
        self.setup.ok_or(SetupError::Size {
            what: Quantity::Pulses,
            wanted: 0,
            most: self.capacity.pulses.into(),
        })
    }

    /// Takes settings for the next run: a rectangular fast-time window, no patches. Ends a run.
    ///
    /// # Errors
    /// [`SetupError`]; nothing has changed.
    pub fn configure(&mut self, setup: &Setup) -> Result<(), SetupError> {
        setup.check(&self.capacity)?;
        self.stop();
        self.setup = Some(*setup);
        self.num_patches = 0;
        self.weights.fill(1.0 / f32::from(setup.num_frequencies));
        Ok(())
    }

    /// Takes weights of the fast-time window from frequency `first` on; all together should sum to 1.
    ///
    /// # Errors
    /// [`SetupError`] if there are not so many frequencies, one is not finite, or there are no settings.
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

    /// Takes patch number `index`; a list is complete at the first index that was not given.
    ///
    /// # Errors
    /// [`SetupError`] if there is no room for it, it does not fit the settings, or there are none.
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

    /// The patches.
    pub fn patches(&self) -> &[Patch] {
        self.patches.get(..self.num_patches).unwrap_or(&[])
    }

    /// Begins a run with pulse `first`; counts from zero.
    ///
    /// # Errors
    /// [`SetupError`] without settings or patches.
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

    /// Gives up everything in hand.
    pub fn stop(&mut self) {
        self.running = false;
        self.stores.iter_mut().for_each(Store::clear);
        self.filling = 0;
        self.patch = 0;
        self.stage = Stage::Begin;
    }

    /// Whether a sub-CPI waits for work or is in work.
    pub fn is_working(&self) -> bool {
        self.stores.iter().any(|store| store.full)
    }

    /// Number of the pulse that is due.
    pub fn next_pulse(&self) -> u32 {
        self.next_pulse
    }

    /// Pulses below this number find room now: the rest of the sub-CPI in hand and the next, as far as
    /// stores are free.
    pub fn accept_through(&self) -> u32 {
        let Some(setup) = self.setup.filter(|_| self.running) else {
            return 0;
        };
        let num_pulses = u32::from(setup.num_pulses).max(1);
        let free = self.stores.iter().filter(|store| !store.full).count() as u32;
        let begun = self.next_pulse - self.next_pulse % num_pulses;
        match free {
            0 => self.next_pulse,
            free => begun.saturating_add(free * num_pulses),
        }
    }

    /// What became of the run's pulses so far.
    pub fn counters(&self) -> PulseCounters {
        // An engine counts for as long as it lives.
        let saturated = self.engine.saturated();
        PulseCounters {
            saturated: saturated.saturating_sub(self.saturated_before),
            ..self.counters
        }
    }

    /// Takes a pulse.
    ///
    /// # Errors
    /// See [`PulseError`].
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
        let num_pulses = u32::from(setup.num_pulses).max(1);
        let place = (pulse.number % num_pulses) as usize;
        let missing = pulse.number - self.next_pulse;
        self.next_pulse = next_pulse;
        self.counters.lost = self.counters.lost.saturating_add(missing);
        if let Err(error) = usable {
            // The next one finds its place empty.
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
        // A gap of a whole number of sub-CPIs leads to the same place: the numbers tell.
        let last = store.count.checked_sub(1);
        let follows = match last.and_then(|last| store.pulses.get(last)) {
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
        let row = store.samples.get_mut(place * frequencies..);
        let row = row.unwrap_or(&mut []).iter_mut();
        let mut at_limit = 0u32;
        for (out, sample) in row.zip(samples) {
            *out = sample;
            at_limit += u32::from(sample.at_limit());
        }
        if let Some(out) = store.pulses.get_mut(place) {
            *out = *pulse;
        }
        store.count = place + 1;
        self.counters.accepted = self.counters.accepted.saturating_add(1);
        self.counters.at_limit = self.counters.at_limit.saturating_add(at_limit);
        if store.count == usize::from(setup.num_pulses) {
            self.turn();
        }
        Ok(())
    }

    /// Takes no more pulses. What there is of a sub-CPI is worked on as one of fewer pulses, unless a
    /// pulse after them is known to be missing.
    pub fn finish(&mut self) {
        self.running = false;
        let Some(store) = self.stores.get_mut(self.filling) else {
            return;
        };
        let last = store.count.checked_sub(1).filter(|_| !store.full);
        let Some(last) = last.and_then(|last| store.pulses.get(last)) else {
            return;
        };
        if last.number.wrapping_add(1) == self.next_pulse {
            self.turn();
        } else {
            self.counters.incomplete = self.counters.incomplete.saturating_add(1);
            store.clear();
        }
    }

    /// Declares the filling store full and fills the other.
    fn turn(&mut self) {
        if let Some(store) = self.stores.get_mut(self.filling) {
            store.full = true;
        }
        self.filling = 1 - self.filling.min(1);
    }

    /// The store to work on: of two full ones the older, which is the one to be filled next.
    fn working(&self) -> Option<usize> {
        let full = |index: usize| self.stores.get(index).is_some_and(|store| store.full);
        let filling = self.filling;
        [filling, 1 - filling.min(1)].into_iter().find(|&i| full(i))
    }

    /// Does one piece of work: a frequency, or a Doppler bin, of one patch.
    pub fn work(&mut self) -> Progress {
        let Some((setup, index)) = self.setup.zip(self.working()) else {
            return Progress::Idle;
        };
        if self.stage == Stage::Ready {
            self.stage = Stage::Begin;
            self.patch += 1;
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
        match self.stage {
            Stage::Ready => Progress::Map,
            _ => Progress::Busy,
        }
    }

    /// The map that is ready, until the work goes on.
    pub fn map(&self) -> Option<PatchMap<'_>> {
        if self.stage != Stage::Ready {
            return None;
        }
        let setup = self.setup.as_ref()?;
        let store = self.stores.get(self.working()?);
        let work = work(setup, self.patches.get(self.patch), self.weights, store)?;
        let (first, last) = (work.pulses.first()?, work.pulses.last()?);
        let header = MapHeader {
            sub_cpi: first.number / u32::from(setup.num_pulses).max(1),
            patch_index: self.patch as u16,
            num_pulses: work.pulses.len() as u16,
            patch: *work.patch,
            time_s: [first.time_s, last.time_s],
            weight_sum: work.pulses.iter().map(|pulse| pulse.weight).sum(),
            nodes: nodes(work.pulses),
        };
        let samples: MapSamples<'_> = self.engine.map(&work);
        Some(PatchMap { header, samples })
    }
}

/// What an engine works on, from the parts of a processor.
fn work<'w, S>(
    setup: &'w Setup,
    patch: Option<&'w Patch>,
    weights: &'w [f32],
    store: Option<&'w Store<'_, S>>,
) -> Option<Work<'w, S>> {
    let store = store?;
    let len = store.count * usize::from(setup.num_frequencies);
    Some(Work {
        setup,
        patch: patch?,
        weights: weights.get(..usize::from(setup.num_frequencies))?,
        pulses: store.pulses.get(..store.count)?,
        samples: store.samples.get(..len)?,
    })
}
