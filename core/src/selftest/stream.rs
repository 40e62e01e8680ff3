//! Self-tests of the stream from pulses to frames, in float32 and in fixed point.
//!
//! Each test does two runs in the same buffers, with even and with odd sizes. Each run has two full sub-CPIs and a partial
//! third, and two patches, one with rows longer than a pulse. **Output**: FNV-1a of the maps in order: header
//! (numbers, times, weight, nodes), bits of the values (in fixed point mantissas, then exponents), and frames of the link.
//!
//! **Memory**: stated by `BYTES`; the fixed-point test fits a part with 16 KiB of RAM. **Cost**: pulses are generated in
//! integers, maps are formed as in [`crate::stream`].

use core::fmt;

use super::scene::{self, Scene};
use super::{Fnv1a, Lcg, frames};
use crate::link::{Encoder, Encoding, max_frame_bytes, row_bytes};
use crate::stream::{
    BlockFloat, Engine, FixedBuffers, FloatBuffers, MapHeader, MapSamples, PatchMap, Progress,
    PulseError, Sample, SetupError, SubCpiProcessor,
};
use crate::{LengthError, Sc16, link};

/// Float32: pulses, frequencies, range transform length, Doppler rows, patches.
type Float = FloatBuffers<12, 64, 64, 15, 2>;
const FLOAT_SCENES: [Scene; 2] = [
    Scene::new([12, 48, 64, 16], [[20, 7], [30, 4]], 5),
    Scene::new([11, 47, 64, 15], [[15, 7], [31, 3]], 4),
];
/// Range bins of the widest row.
const FLOAT_WIDTH: usize = 63;

/// Fixed point: as above, with exponent blocks as fifth.
type Fixed = FixedBuffers<6, 42, 64, 9, 3, 2>;
const FIXED_SCENES: [Scene; 2] = [
    Scene::new([6, 24, 64, 16], [[10, 4], [20, 2]], 3),
    Scene::new([5, 23, 32, 9], [[8, 4], [15, 2]], 2),
];
const FIXED_WIDTH: usize = 41;

/// Bytes of a row of `width` samples.
const fn row_len(encoding: Encoding, width: usize) -> usize {
    match row_bytes(encoding, width) {
        Some(bytes) => bytes,
        None => 0,
    }
}

/// Buffers for rows and frames.
#[derive(Debug)]
struct LinkBuffers<const ROW: usize, const FRAME: usize> {
    row: [u8; ROW],
    frame: [u8; FRAME],
}

impl<const ROW: usize, const FRAME: usize> LinkBuffers<ROW, FRAME> {
    const fn new() -> Self {
        Self {
            row: [0; ROW],
            frame: [0; FRAME],
        }
    }
}

/// Stream self-test in float32 with its buffers. Intended as a static.
#[derive(Debug)]
pub struct FloatStreamSelfTest {
    buffers: Float,
    link: LinkBuffers<
        { row_len(Encoding::Complex32, FLOAT_WIDTH) },
        { max_frame_bytes(FLOAT_WIDTH) },
    >,
}

impl FloatStreamSelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers. All bytes are zero.
    pub const fn new() -> Self {
        Self {
            buffers: FloatBuffers::new(),
            link: LinkBuffers::new(),
        }
    }

    /// Run the test and return the checksum.
    ///
    /// # Errors
    /// None in a correct build, as for [`super::SelfTest::run`].
    pub fn run(&mut self) -> Result<u32, StreamSelfTestError> {
        self.run_with(|_| ())
    }

    /// Like [`FloatStreamSelfTest::run`], and pass every map to `see`.
    ///
    /// # Errors
    /// None in a correct build, as for [`super::SelfTest::run`].
    pub fn run_with(&mut self, see: impl FnMut(&PatchMap<'_>)) -> Result<u32, StreamSelfTestError> {
        let LinkBuffers { row, frame } = &mut self.link;
        let mut runner = Runner::new(row, frame, see);
        let mut processor = self.buffers.processor();
        for scene in &FLOAT_SCENES {
            runner.run(&mut processor, scene, Sc16::to_complex32)?;
        }
        Ok(runner.checksum.0)
    }
}

impl Default for FloatStreamSelfTest {
    fn default() -> Self {
        Self::new()
    }
}

/// Stream self-test in fixed point with its buffers. Intended as a static.
#[derive(Debug)]
pub struct FixedStreamSelfTest {
    buffers: Fixed,
    link: LinkBuffers<{ row_len(Encoding::Sc16, FIXED_WIDTH) }, { max_frame_bytes(FIXED_WIDTH) }>,
}

impl FixedStreamSelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers. All bytes are zero.
    pub const fn new() -> Self {
        Self {
            buffers: FixedBuffers::new(),
            link: LinkBuffers::new(),
        }
    }

    /// Run the test and return the checksum.
    ///
    /// # Errors
    /// None in a correct build, as for [`super::SelfTest::run`].
    pub fn run(&mut self) -> Result<u32, StreamSelfTestError> {
        self.run_with(|_| ())
    }

    /// Like [`FixedStreamSelfTest::run`], and pass every map to `see`.
    ///
    /// # Errors
    /// None in a correct build, as for [`super::SelfTest::run`].
    pub fn run_with(&mut self, see: impl FnMut(&PatchMap<'_>)) -> Result<u32, StreamSelfTestError> {
        let LinkBuffers { row, frame } = &mut self.link;
        let mut runner = Runner::new(row, frame, see);
        let mut processor = self
            .buffers
            .processor()
            .map_err(StreamSelfTestError::Buffer)?;
        for scene in &FIXED_SCENES {
            runner.run(&mut processor, scene, |sample| sample)?;
        }
        Ok(runner.checksum.0)
    }
}

impl Default for FixedStreamSelfTest {
    fn default() -> Self {
        Self::new()
    }
}

/// Runs scenes through a processor and accumulates the checksum.
struct Runner<'b, V> {
    row: &'b mut [u8],
    frame: &'b mut [u8],
    see: V,
    checksum: Fnv1a,
    encoder: Encoder,
    maps: u32,
}

impl<'b, V: FnMut(&PatchMap<'_>)> Runner<'b, V> {
    fn new(row: &'b mut [u8], frame: &'b mut [u8], see: V) -> Self {
        Self {
            row,
            frame,
            see,
            checksum: Fnv1a::new(),
            encoder: Encoder::new(),
            maps: 0,
        }
    }

    fn run<E: Engine<Sample: Sample>>(
        &mut self,
        processor: &mut SubCpiProcessor<'_, E>,
        scene: &Scene,
        convert: impl Fn(Sc16) -> E::Sample + Clone,
    ) -> Result<(), StreamSelfTestError> {
        let setup = |result: Result<(), SetupError>| result.map_err(StreamSelfTestError::Setup);
        setup(processor.configure(&scene.setup))?;
        setup(processor.set_weights(0, scene.weights()))?;
        for (index, patch) in scene.patches.iter().enumerate() {
            setup(processor.set_patch(index, patch))?;
        }
        setup(processor.start(0))?;
        self.maps = 0;
        let mut noise = Lcg(2026);
        for number in 0..scene.num_pulses() {
            let frequencies = scene.setup.num_frequencies;
            let samples = scene::samples(number, frequencies, noise.clone()).map(convert.clone());
            processor
                .push(&scene::pulse(number), samples)
                .map_err(StreamSelfTestError::Pulse)?;
            noise.skip(2 * u32::from(frequencies));
            self.drain(processor)?;
        }
        processor.finish();
        self.drain(processor)?;
        let (expected, got) = (scene.num_maps(), self.maps);
        if expected != got {
            return Err(StreamSelfTestError::Maps { expected, got });
        }
        Ok(())
    }

    /// Work until the processor is idle.
    fn drain<E: Engine<Sample: Sample>>(
        &mut self,
        processor: &mut SubCpiProcessor<'_, E>,
    ) -> Result<(), StreamSelfTestError> {
        loop {
            match processor.work() {
                Progress::Idle => return Ok(()),
                Progress::Busy => {}
                Progress::Map => {
                    if let Some(map) = processor.map() {
                        self.take(&map)?;
                    }
                }
            }
        }
    }

    fn take(&mut self, map: &PatchMap<'_>) -> Result<(), StreamSelfTestError> {
        (self.see)(map);
        add_header(&mut self.checksum, &map.header);
        match map.samples {
            MapSamples::Float(samples) => self.checksum.add_samples(samples),
            MapSamples::Fixed(BlockFloat {
                mantissas,
                exponents,
            }) => {
                for part in mantissas.iter().flat_map(|z| [z.re, z.im]) {
                    self.checksum.add_bytes(&part.to_bits().to_le_bytes());
                }
                for exponent in exponents {
                    self.checksum.add_bytes(&exponent.to_le_bytes());
                }
            }
        }
        frames::add_frames(
            &mut self.checksum,
            &mut self.encoder,
            self.maps,
            map,
            self.row,
            self.frame,
        )
        .map_err(StreamSelfTestError::Encode)?;
        self.maps += 1;
        Ok(())
    }
}

/// Fields of a header without the patch.
fn add_header(checksum: &mut Fnv1a, header: &MapHeader) {
    checksum.add_bytes(&header.sub_cpi.to_le_bytes());
    checksum.add_bytes(&header.patch_index.to_le_bytes());
    checksum.add_bytes(&header.num_pulses.to_le_bytes());
    checksum.add(header.weight_sum);
    let nodes = header.nodes.iter();
    let positions_m = nodes.flat_map(|node| [node.transmitter_m, node.receiver_m]);
    for value in header.time_s.into_iter().chain(positions_m.flatten()) {
        checksum.add_bytes(&value.to_bits().to_le_bytes());
    }
}

/// Step that rejected valid data.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum StreamSelfTestError {
    /// A buffer is too short.
    Buffer(LengthError),
    /// The setup or a patch was rejected.
    Setup(SetupError),
    /// A pulse was rejected.
    Pulse(PulseError),
    /// A frame could not be encoded.
    Encode(link::EncodeError),
    /// The number of maps is wrong.
    Maps {
        /// Expected number of maps.
        expected: u32,
        /// Actual number of maps.
        got: u32,
    },
}

impl fmt::Display for StreamSelfTestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Buffer(error) => write!(f, "stream self-test: {error}"),
            Self::Setup(error) => write!(f, "stream self-test: {error}"),
            Self::Pulse(error) => write!(f, "stream self-test: {error}"),
            Self::Encode(error) => write!(f, "stream self-test: {error}"),
            Self::Maps { expected, got } => {
                write!(f, "stream self-test: expected {expected} maps, found {got}")
            }
        }
    }
}

impl core::error::Error for StreamSelfTestError {}
