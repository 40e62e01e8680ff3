//! The core run on the host beside the module: every map that comes has to be the same, bit by bit.
//!
//! **Cost**: the core's work again on this machine, a sub-CPI at a time, while the line waits; memory of
//! the stores and of one sub-CPI's maps.

use subaperture_core::Complex32;
use subaperture_core::link::{AssembledMap, Encoding, complex32s, write_complex32s};
use subaperture_core::stream::{
    Capacity, FloatEngine, MapHeader, MapSamples, Patch, Progress, PulsePhase, SetupError, Store,
    SubCpiProcessor,
};

use super::job::Job;
use super::session::{MapSink, SinkError};
use crate::phase_history::ReadError;

/// The core on the host, in float32.
pub struct HostCore<'a> {
    job: Job<'a>,
    capacity: Capacity,
    /// The sub-CPI whose maps these are.
    sub_cpi: Option<u32>,
    maps: Vec<(MapHeader, Vec<u8>)>,
}

impl<'a> HostCore<'a> {
    /// A core with buffers of this job's sizes; none if it is not of floating-point samples.
    ///
    /// # Errors
    /// [`SetupError`] if the settings cannot be.
    pub fn new(job: Job<'a>) -> Result<Option<Self>, SetupError> {
        if job.pulses.encoding() != Encoding::Complex32 {
            return Ok(None);
        }
        let setup = &job.setup;
        let frequencies = usize::from(setup.num_frequencies).max(1);
        let samples = |patch: &Patch| patch.num_doppler_bins() * setup.row_stride(patch);
        let largest = job.patches.iter().map(samples).max().unwrap_or(0);
        let capacity = Capacity {
            pulses: setup.num_pulses,
            frequencies: setup.num_frequencies,
            range_bins: setup.range_length,
            doppler_bins: u16::try_from(largest.div_ceil(frequencies)).unwrap_or(u16::MAX),
            patches: u16::try_from(job.patches.len()).unwrap_or(u16::MAX),
        };
        setup.check(&capacity)?;
        for patch in &job.patches {
            setup.check_patch(patch, &capacity)?;
        }
        Ok(Some(Self {
            job,
            capacity,
            sub_cpi: None,
            maps: Vec::new(),
        }))
    }

    /// The maps of a sub-CPI, one a patch: headers, and samples as they go over the wire.
    ///
    /// # Errors
    /// [`ReadError`] if the recording cannot be read.
    pub fn maps(&mut self, sub_cpi: u32) -> Result<&[(MapHeader, Vec<u8>)], ReadError> {
        if self.sub_cpi != Some(sub_cpi) {
            self.sub_cpi = None;
            self.compute(sub_cpi)?;
            self.sub_cpi = Some(sub_cpi);
        }
        Ok(&self.maps)
    }

    fn compute(&mut self, sub_cpi: u32) -> Result<(), ReadError> {
        let setup = self.job.setup;
        let (pulses, frequencies) = (
            usize::from(setup.num_pulses),
            usize::from(setup.num_frequencies),
        );
        let cells = usize::from(self.capacity.doppler_bins) * frequencies;
        let mut map = vec![Complex32::ZERO; cells];
        let mut row = vec![Complex32::ZERO; setup.range_length.into()];
        let mut column = vec![Complex32::ZERO; pulses];
        let mut phases = vec![PulsePhase::EMPTY; pulses];
        let mut weights = vec![0.0; frequencies];
        let mut patches = vec![Patch::EMPTY; self.job.patches.len()];
        let mut samples = vec![Complex32::ZERO; 2 * pulses * frequencies];
        let mut stored = vec![subaperture_core::Pulse::EMPTY; 2 * pulses];
        let (a, b) = samples.split_at_mut(pulses * frequencies);
        let (first, second) = stored.split_at_mut(pulses);
        let mut processor = SubCpiProcessor::from_parts(
            FloatEngine::new(&mut map, &mut row, &mut column, &mut phases),
            self.capacity,
            &mut weights,
            &mut patches,
            [Store::new(a, first), Store::new(b, second)],
        );
        let sound = "settings were checked when this core was made";
        processor.configure(&setup).expect(sound);
        processor
            .set_weights(0, self.job.fast_weights.iter().copied())
            .expect(sound);
        for (index, patch) in self.job.patches.iter().enumerate() {
            processor.set_patch(index, patch).expect(sound);
        }
        let wanted = self.job.wanted();
        let range = wanted.first_pulse(sub_cpi)..wanted.first_pulse(sub_cpi + 1);
        processor.start(range.start).expect(sound);
        for number in range {
            let (pulse, bytes) = self.job.pulses.pulse(number)?;
            processor
                .push(&pulse, complex32s(bytes))
                .expect("pulses of a recording are finite and in order");
        }
        processor.finish();
        self.maps.clear();
        loop {
            match processor.work() {
                Progress::Busy => {}
                Progress::Idle => return Ok(()),
                Progress::Map => {
                    let map = processor.map().expect("a map is ready");
                    let MapSamples::Float(values) = map.samples else {
                        unreachable!("the engine is in floating point");
                    };
                    let mut bytes = vec![0; 8 * values.len()];
                    write_complex32s(values, &mut bytes).expect("8 bytes a sample");
                    self.maps.push((map.header, bytes));
                }
            }
        }
    }
}

/// A sink that hands on only the maps that are the core's own.
pub struct Verified<'a, S> {
    inner: S,
    core: HostCore<'a>,
    same: u64,
    different: u64,
}

impl<'a, S: MapSink> Verified<'a, S> {
    /// Compares with `core` before `inner` gets a map.
    pub fn new(inner: S, core: HostCore<'a>) -> Self {
        Self {
            inner,
            core,
            same: 0,
            different: 0,
        }
    }

    /// Maps that were the same and maps that were not.
    pub fn counts(&self) -> (u64, u64) {
        (self.same, self.different)
    }

    /// The sink within.
    pub fn into_inner(self) -> S {
        self.inner
    }
}

impl<S: MapSink> MapSink for Verified<'_, S> {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        let header = &map.header;
        let expected = self.core.maps(header.sub_cpi)?;
        let same =
            expected
                .get(usize::from(header.patch_index))
                .is_some_and(|(expected, bytes)| {
                    expected == header && bytes == map.bytes && map.encoding == Encoding::Complex32
                });
        if !same {
            self.different += 1;
            return Ok(());
        }
        self.same += 1;
        self.inner.accept(map)
    }
}
