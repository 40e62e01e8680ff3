//! Verification: the core runs on the host as well, and every received map must be bit-identical.
//!
//! **Cost**: the core's work on this machine, one sub-CPI at a time, while the line waits; memory for the stores and the maps
//! of one sub-CPI.

use std::ops::Range;

use num_complex::{Complex, Complex32};
use subaperture_core::fixed_point::{self, FixedSlices};
use subaperture_core::link::{
    AssembledMap, Encoding, complex32s, row_bytes, sc16s, write_block_row, write_complex32s,
};
use subaperture_core::stream::{
    BlockFloat, Capacity, Engine, FixedEngine, FloatEngine, MapHeader, MapSamples, Patch, PatchMap,
    Progress, PulsePhase, Sample, Setup, SetupError, Store, SubCpiProcessor,
};
use subaperture_core::{Pulse, Sc16};

use super::ending::SinkError;
use super::job::Job;
use super::products::MapSink;
use crate::maps::{Arithmetic, OwnedMap};
use crate::plan::least_capacity;
use subaperture_model::phase_history::ReadError;

/// Why the buffers are long enough.
const LENT: &str = "buffers have the lengths that the capacity states";

/// Core on the host, in the arithmetic of the job's samples.
pub struct HostCore<'a> {
    job: Job<'a>,
    capacity: Capacity,
    /// Sub-CPI of the computed maps.
    sub_cpi: Option<u32>,
    maps: Vec<(MapHeader, Vec<u8>)>,
}

impl<'a> HostCore<'a> {
    /// Create a core with buffers for this job.
    ///
    /// # Errors
    /// [`SetupError`] if the settings are invalid.
    pub fn new(job: Job<'a>) -> Result<Self, SetupError> {
        let setup = &job.setup;
        let arithmetic = match job.pulses.encoding() {
            Encoding::Complex32 => Arithmetic::Float,
            Encoding::Sc16 => Arithmetic::Fixed,
        };
        let capacity = least_capacity(setup, &job.patches, arithmetic);
        setup.check(&capacity)?;
        for patch in &job.patches {
            setup.check_patch(patch, &capacity)?;
        }
        Ok(Self {
            job,
            capacity,
            sub_cpi: None,
            maps: Vec::new(),
        })
    }

    /// Maps of a sub-CPI, one per patch: headers, and samples in the link's encoding.
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

    /// Settings of the stream processor.
    pub fn setup(&self) -> &Setup {
        &self.job.setup
    }

    /// Encoding of pulses, maps and pixels.
    pub fn encoding(&self) -> Encoding {
        self.job.pulses.encoding()
    }

    /// Maps of a sub-CPI, one per patch.
    ///
    /// # Errors
    /// [`ReadError`] if the recording cannot be read.
    pub fn owned_maps(&mut self, sub_cpi: u32) -> Result<Vec<OwnedMap>, ReadError> {
        let encoding = self.job.pulses.encoding();
        let maps = self.maps(sub_cpi)?.iter().map(|(header, bytes)| {
            OwnedMap::from(&AssembledMap {
                map: 0,
                header: *header,
                encoding,
                bytes,
            })
        });
        Ok(maps.collect())
    }

    fn compute(&mut self, sub_cpi: u32) -> Result<(), ReadError> {
        let wanted = self.job.wanted();
        let range = wanted.first_pulse(sub_cpi)..wanted.first_pulse(sub_cpi + 1);
        let capacity = self.capacity;
        let pulses = usize::from(capacity.pulses);
        self.maps = match self.job.pulses.encoding() {
            Encoding::Complex32 => {
                let zero = Complex32::ZERO;
                let mut cells = vec![zero; FixedSlices::cells_len(&capacity)];
                let mut row = vec![zero; capacity.range_bins.into()];
                let mut column = vec![zero; pulses];
                let mut phases = vec![PulsePhase::EMPTY; pulses];
                let engine = FloatEngine::new(&mut cells, &mut row, &mut column, &mut phases);
                let decode = |bytes: &[u8]| complex32s(bytes).collect();
                run(engine, zero, capacity, &mut self.job, range, decode)?
            }
            Encoding::Sc16 => {
                let zero = Complex { re: 0, im: 0 };
                let slices = FixedSlices {
                    cells: &mut vec![Sc16::ZERO; FixedSlices::cells_len(&capacity)],
                    column_exponents: &mut vec![0; FixedSlices::column_exponents_len(&capacity)],
                    row_exponents: &mut vec![0; FixedSlices::row_exponents_len(&capacity)],
                    work: &mut vec![zero; FixedSlices::work_len(&capacity)],
                    phases: &mut vec![fixed_point::PulsePhase::EMPTY; pulses],
                    folded: &mut vec![zero; pulses],
                };
                let engine = FixedEngine::new(slices, &capacity).expect(LENT);
                let decode = |bytes: &[u8]| sc16s(bytes).collect();
                run(engine, Sc16::ZERO, capacity, &mut self.job, range, decode)?
            }
        };
        Ok(())
    }
}

/// Compute the maps of one sub-CPI on an engine whose buffers suit `capacity`.
fn run<E: Engine<Sample: Sample>>(
    engine: E,
    zero: E::Sample,
    capacity: Capacity,
    job: &mut Job<'_>,
    pulses: Range<u32>,
    decode: impl Fn(&[u8]) -> Vec<E::Sample>,
) -> Result<Vec<(MapHeader, Vec<u8>)>, ReadError> {
    let (depth, frequencies) = (
        usize::from(capacity.pulses),
        usize::from(capacity.frequencies),
    );
    let mut weights = vec![0.0; frequencies];
    let mut patches = vec![Patch::EMPTY; job.patches.len()];
    let mut headers = vec![Pulse::EMPTY; 2 * depth];
    let mut samples = vec![zero; 2 * depth * frequencies];
    let (first, second) = headers.split_at_mut(depth);
    let (a, b) = samples.split_at_mut(depth * frequencies);
    let stores = [Store::new(a, first), Store::new(b, second)];
    let processor =
        SubCpiProcessor::from_parts(engine, capacity, &mut weights, &mut patches, stores);
    let mut processor = processor.expect(LENT);
    let sound = "settings were checked when this core was made";
    processor.configure(&job.setup).expect(sound);
    processor
        .set_weights(0, job.fast_weights.iter().copied())
        .expect(sound);
    for (index, patch) in job.patches.iter().enumerate() {
        processor.set_patch(index, patch).expect(sound);
    }
    processor.start(pulses.start).expect(sound);
    for number in pulses {
        let (pulse, bytes) = job.pulses.pulse(number)?;
        processor
            .push(&pulse, decode(bytes).iter().copied())
            .map_err(|error| {
                ReadError::Mismatch(format!("core rejected pulse {number}: {error}"))
            })?;
    }
    processor.finish();
    let mut maps = Vec::new();
    loop {
        match processor.work() {
            Progress::Busy => {}
            Progress::Idle => return Ok(maps),
            Progress::Map => {
                let map = processor.map().expect("a map is ready");
                maps.push((map.header, on_the_wire(&map)));
            }
        }
    }
}

/// Samples of a map in the link's encoding.
fn on_the_wire(map: &PatchMap<'_>) -> Vec<u8> {
    let width = map.header.patch.num_range_bins();
    let rows = map.header.patch.num_doppler_bins();
    let room = |encoding| row_bytes(encoding, width).unwrap_or(0);
    let enough = "a buffer of the row's length";
    match map.samples {
        MapSamples::Float(values) => {
            let mut bytes = vec![0; rows * room(Encoding::Complex32)];
            write_complex32s(values, &mut bytes).expect(enough);
            bytes
        }
        MapSamples::Fixed(BlockFloat {
            mantissas,
            exponents,
        }) => {
            let mut row = vec![0; room(Encoding::Sc16)];
            let exponents = exponents.chunks(BlockFloat::blocks(width));
            let rows = mantissas.chunks(width).zip(exponents);
            rows.flat_map(|(mantissas, exponents)| {
                write_block_row(mantissas, exponents, &mut row)
                    .expect(enough)
                    .to_vec()
            })
            .collect()
        }
    }
}

/// Sink that passes on only maps that are bit-identical to the core's.
pub struct Verified<'a, S> {
    inner: S,
    core: HostCore<'a>,
    same: u64,
    different: u64,
}

impl<'a, S: MapSink> Verified<'a, S> {
    /// Create a sink that compares each map with `core` before passing it to `inner`.
    pub fn new(inner: S, core: HostCore<'a>) -> Self {
        Self {
            inner,
            core,
            same: 0,
            different: 0,
        }
    }

    /// Numbers of identical and different maps.
    pub fn counts(&self) -> (u64, u64) {
        (self.same, self.different)
    }

    /// Wrapped sink of the maps.
    pub fn into_inner(self) -> S {
        self.inner
    }
}

impl<S: MapSink> MapSink for Verified<'_, S> {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        let header = &map.header;
        let encoding = self.core.job.pulses.encoding();
        let expected = self.core.maps(header.sub_cpi)?;
        let same =
            expected
                .get(usize::from(header.patch_index))
                .is_some_and(|(expected, bytes)| {
                    expected == header && bytes == map.bytes && map.encoding == encoding
                });
        if !same {
            self.different += 1;
            return Ok(());
        }
        self.same += 1;
        self.inner.accept(map)
    }
}
