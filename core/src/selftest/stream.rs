//! The streaming core from pulses to frames, in float32 and in fixed point.
//!
//! **What it does.** Two runs in the same buffers, of even and of odd sizes, each two sub-CPIs and a
//! part of a third, two patches; a patch of each has rows longer than a pulse. **Output**: FNV-1a of the
//! maps in the order they come: the header (numbers, times, weight, nodes), the values' bits (in fixed
//! point mantissas, then exponents), the frames of the link.
//!
//! **Memory**: what `BYTES` states; the fixed-point one is for a part of 16 KiB of RAM.
//! **Cost**: the pulses are made in integers, the maps as [`crate::stream`] makes them.

use core::fmt;

use super::scene::{self, Scene};
use super::{Fnv1a, Lcg, frames};
use crate::link::{Encoder, Encoding, max_frame_bytes, row_bytes};
use crate::stream::{
    BlockFloat, Engine, FixedBuffers, FloatBuffers, MapHeader, MapSamples, PatchMap, Progress,
    PulseError, Sample, SetupError, SubCpiProcessor,
};
use crate::{LengthError, Sc16, link};

/// Float32: pulses, frequencies, points of the range transform, Doppler rows, patches.
type Float = FloatBuffers<12, 64, 64, 15, 2>;
const FLOAT_SCENES: [Scene; 2] = [
    Scene::new([12, 48, 64, 16], [[20, 7], [30, 4]], 5),
    Scene::new([11, 47, 64, 15], [[15, 7], [31, 3]], 4),
];
/// Range bins of the widest row.
const FLOAT_WIDTH: usize = 63;

/// Fixed point: as above, the fifth is blocks.
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

/// Where frames are made.
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

/// Buffers of the self-test in float32; made to be a static.
#[derive(Debug)]
pub struct FloatStreamSelfTest {
    buffers: Float,
    link: LinkBuffers<
        { row_len(Encoding::Complex32, FLOAT_WIDTH) },
        { max_frame_bytes(FLOAT_WIDTH) },
    >,
}

impl FloatStreamSelfTest {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Empty buffers, all zero bytes.
    pub const fn new() -> Self {
        Self {
            buffers: FloatBuffers::new(),
            link: LinkBuffers::new(),
        }
    }

    /// Runs the test and returns the checksum.
    ///
    /// # Errors
    /// As [`super::SelfTest::run`].
    pub fn run(&mut self) -> Result<u32, StreamSelfTestError> {
        self.run_with(|_| ())
    }

    /// As [`FloatStreamSelfTest::run`]; `see` is shown every map.
    ///
    /// # Errors
    /// As [`super::SelfTest::run`].
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

/// Buffers of the self-test in fixed point; made to be a static.
#[derive(Debug)]
pub struct FixedStreamSelfTest {
    buffers: Fixed,
    link: LinkBuffers<{ row_len(Encoding::Sc16, FIXED_WIDTH) }, { max_frame_bytes(FIXED_WIDTH) }>,
}

impl FixedStreamSelfTest {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Empty buffers, all zero bytes.
    pub const fn new() -> Self {
        Self {
            buffers: FixedBuffers::new(),
            link: LinkBuffers::new(),
        }
    }

    /// Runs the test and returns the checksum.
    ///
    /// # Errors
    /// As [`super::SelfTest::run`].
    pub fn run(&mut self) -> Result<u32, StreamSelfTestError> {
        self.run_with(|_| ())
    }

    /// As [`FixedStreamSelfTest::run`]; `see` is shown every map.
    ///
    /// # Errors
    /// As [`super::SelfTest::run`].
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

/// Takes scenes through a processor and sums up what comes out.
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

    /// Does all the work there is.
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

/// What a header has beside the patch.
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

/// Which step refused what it should accept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StreamSelfTestError {
    /// The buffers.
    Buffer(LengthError),
    /// The settings or a patch.
    Setup(SetupError),
    /// A pulse.
    Pulse(PulseError),
    /// A frame.
    Encode(link::EncodeError),
    /// Too few or too many maps came.
    Maps {
        /// Maps of the run.
        expected: u32,
        /// Maps that came.
        got: u32,
    },
}

impl fmt::Display for StreamSelfTestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Buffer(error) => write!(f, "stream self-test: {error}"),
            Self::Setup(error) => write!(f, "stream self-test: {error}"),
            Self::Pulse(error) => write!(f, "stream self-test: a pulse was not taken: {error:?}"),
            Self::Encode(error) => write!(f, "stream self-test: {error}"),
            Self::Maps { expected, got } => {
                write!(f, "stream self-test: {got} maps came, not {expected}")
            }
        }
    }
}

impl core::error::Error for StreamSelfTestError {}
