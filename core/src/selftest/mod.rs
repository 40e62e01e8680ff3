//! Self-tests: synthetic data through the processing chain, with a checksum that must be equal on every machine.
//!
//! Rust does not contract `a*b + c` or reorder floating-point operations, and the FFTs and functions used are pure Rust, so
//! bit-identical results can be required on host and target. Input: pseudo-random integers and three scatterers whose phase
//! is a product of integers. Output: FNV-1a (Fowler, Noll, Vo; 32 bits, over little-endian bytes).
//!
//! | test | processing | checksum over |
//! |---|---|---|
//! | [`SelfTest`] | one sub-CPI through [`Plan`], by the sinc and by the chirp-z keystone | both maps, pixels, power |
//! | `FloatStreamSelfTest`, `FixedStreamSelfTest` (feature `link`) | two runs of the stream | maps with headers, frames of the link |
//! | `MotionSelfTest` (feature `motion`) | echoes through `motion::Pairwise` | increments in float64 |
//! | `SweepSelfTest` (feature `sweep`) | bursts through `sweep::Profiler` | range profiles |
//! | `OdometerSelfTest` (feature `motion`) | samples through `motion::Odometer` | steps: increments, residuals, counts |
//!
//! `tests/stream/selftest.rs` holds the expected checksums. `tests/firmware/selftest.rs` and `tests/firmware/golden.rs`
//! compare those of other machines.

#[cfg(feature = "link")]
mod frames;
#[cfg(feature = "motion")]
mod motion;
#[cfg(feature = "motion")]
mod odometer;
#[cfg(feature = "link")]
mod scene;
#[cfg(feature = "link")]
mod stream;
#[cfg(feature = "sweep")]
mod sweep;

#[cfg(feature = "motion")]
pub use motion::{MOTION_PULSES, MotionSelfTest};
#[cfg(feature = "motion")]
pub use odometer::{ODOMETER_PULSES, OdometerSelfTest, OdometerSelfTestError};
#[cfg(feature = "link")]
pub use stream::{FixedStreamSelfTest, FloatStreamSelfTest, StreamSelfTestError};
#[cfg(feature = "sweep")]
pub use sweep::{SWEEPS, SweepSelfTest, SweepSelfTestError};

use num_complex::Complex32;

use crate::accumulate::{Centre, PixelGrid, add_map, add_power};
use crate::keystone::KeystoneTable;
use crate::{LengthError, Map, ParamError, Params, Plan, Shape, Tables, Turns, Window};

/// Number of pulses of the synthetic sub-CPI.
pub const PULSES: usize = 32;
/// Number of frequencies of the synthetic sub-CPI.
pub const FREQUENCIES: usize = 64;
/// Number of range bins of the map.
pub const RANGE_BINS: usize = 128;
/// Number of Doppler bins of the map.
pub const DOPPLER_BINS: usize = 64;
/// Length of the chirp transforms.
pub const CHIRP_LENGTH: usize = SHAPE.chirp_length();
/// Number of pixels of the image.
pub const PIXELS: usize = 256;

const SHAPE: Shape = Shape {
    num_pulses: PULSES,
    num_frequencies: FREQUENCIES,
    num_range_bins: RANGE_BINS,
    num_doppler_bins: DOPPLER_BINS,
};

/// Parameters of the synthetic sub-CPI: 200 MHz around 10 GHz, with both windows.
pub const PARAMS: Params<'static> = Params {
    start_hz: 9.9e9,
    step_hz: 3.125e6,
    fast_window: Window::Taylor { side_lobe_db: 35.0 },
    slow_window: Window::Hamming,
};

/// Batch self-test with its buffers. Intended as a static.
#[derive(Debug)]
pub struct SelfTest {
    fast_weights: [f32; FREQUENCIES],
    slow_weights: [f32; PULSES],
    matrix: [[[f32; PULSES]; PULSES]; FREQUENCIES],
    history: [[Complex32; PULSES]; FREQUENCIES],
    /// The sinc keystone uses the first `DOPPLER_BINS` samples.
    scratch: [[Complex32; CHIRP_LENGTH]; 3],
    map: [[Complex32; RANGE_BINS]; DOPPLER_BINS],
    image: [Complex32; PIXELS],
    power: [[f32; RANGE_BINS]; DOPPLER_BINS],
}

impl SelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers.
    pub const fn new() -> Self {
        Self {
            fast_weights: [0.0; FREQUENCIES],
            slow_weights: [0.0; PULSES],
            matrix: [[[0.0; PULSES]; PULSES]; FREQUENCIES],
            history: [[Complex32::ZERO; PULSES]; FREQUENCIES],
            scratch: [[Complex32::ZERO; CHIRP_LENGTH]; 3],
            map: [[Complex32::ZERO; RANGE_BINS]; DOPPLER_BINS],
            image: [Complex32::ZERO; PIXELS],
            power: [[0.0; RANGE_BINS]; DOPPLER_BINS],
        }
    }

    /// Run the test and return the checksum.
    ///
    /// # Errors
    /// None in a correct build. Errors are returned so that a target need not panic.
    pub fn run(&mut self) -> Result<u32, SelfTestError> {
        // 16 x 16 pixels of 0.5 m around a point at 1 km, at broadside.
        let grid = PixelGrid {
            origin_m: [-4.0, 996.0, 0.0],
            column_step_m: [0.5, 0.0, 0.0],
            row_step_m: [0.0, 0.5, 0.0],
            num_columns: 16,
            num_rows: 16,
        };
        self.image.fill(Complex32::ZERO);
        let power = self.power.as_flattened_mut();
        power.fill(0.0);
        let mut checksum = Fnv1a::new();
        let centre = Centre::monostatic([0.0, 0.0, 300.0], [0.125, 0.01, 0.0], [0.0, 1000.0, 0.0]);
        for exact in [false, true] {
            let keystone = if exact {
                KeystoneTable::ChirpZ {
                    length: CHIRP_LENGTH,
                }
            } else {
                KeystoneTable::Sinc(self.matrix.as_flattened_mut().as_flattened_mut())
            };
            let tables = Tables {
                fast_weights: &mut self.fast_weights,
                slow_weights: &mut self.slow_weights,
                keystone,
            };
            let plan = Plan::new(SHAPE, &PARAMS, tables).map_err(SelfTestError::Plan)?;
            let history = self.history.as_flattened_mut();
            window_synthetic(&plan, history).map_err(SelfTestError::Buffer)?;
            let scratch = self.scratch.as_flattened_mut();
            let scratch = scratch.get_mut(..plan.scratch_len()).unwrap_or(&mut []);
            let map = self.map.as_flattened_mut();
            plan.process(history, scratch, map)
                .map_err(SelfTestError::Buffer)?;
            let map = Map::new(*plan.axes(), map).map_err(SelfTestError::Buffer)?;
            add_map(&mut self.image, &grid, &map, &centre, 0.5).map_err(SelfTestError::Buffer)?;
            add_power(&mut *power, map.samples()).map_err(SelfTestError::Buffer)?;
            checksum.add_samples(map.samples());
        }
        checksum.add_samples(&self.image);
        for value in power {
            checksum.add(*value);
        }
        Ok(checksum.0)
    }
}

impl Default for SelfTest {
    fn default() -> Self {
        Self::new()
    }
}

/// Step that rejected valid data.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SelfTestError {
    /// The plan was rejected.
    Plan(ParamError),
    /// A buffer has the wrong length.
    Buffer(LengthError),
}

impl core::fmt::Display for SelfTestError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Plan(error) => write!(f, "self-test: {error}"),
            Self::Buffer(error) => write!(f, "self-test: {error}"),
        }
    }
}

impl core::error::Error for SelfTestError {}

/// Sample `k` of pulse `m` without noise: three scatterers of amplitudes 1, 1/2 and 1/4 with phases
/// `t0 + tk k + tm m + tkm k m` in 2^-32 turns.
fn scatterers(m: usize, k: usize) -> Complex32 {
    const PHASES: [(f32, [i64; 4]); 3] = [
        (1.0, [0, -50_000_000, 300_000_000, 96_000]),
        (0.5, [1 << 30, 210_000_000, -700_000_000, -220_000]),
        (0.25, [3 << 29, 12_345_678, 98_765_432, 31_000]),
    ];
    let (m, k) = (m as i64, k as i64);
    PHASES
        .iter()
        .map(|(amplitude, [t0, tk, tm, tkm])| {
            let turns = t0 + tk * k + tm * m + tkm * k * m;
            Turns(turns as u64).times(1 << 32).phasor() * *amplitude
        })
        .sum()
}

/// Window the synthetic pulses into `history`.
fn window_synthetic(plan: &Plan<'_>, history: &mut [Complex32]) -> Result<(), LengthError> {
    let mut noise = Lcg(2026);
    let mut pulse = [Complex32::ZERO; FREQUENCIES];
    for m in 0..PULSES {
        for (k, sample) in pulse.iter_mut().enumerate() {
            *sample = scatterers(m, k) + Complex32::new(noise.next(), noise.next()) * 0.125;
        }
        plan.window(m, &pulse, history)?;
    }
    Ok(())
}

/// Knuth's 64-bit linear congruential generator (MMIX).
#[derive(Clone)]
struct Lcg(u64);

impl Lcg {
    /// Upper half of the next state.
    fn next_bits(&mut self) -> i32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as i32
    }

    /// Uniform in [-1, 1) with 24 bits, exact in float32.
    fn next(&mut self) -> f32 {
        (self.next_bits() >> 8) as f32 / 8_388_608.0
    }
}

struct Fnv1a(u32);

impl Fnv1a {
    const fn new() -> Self {
        Self(0x811c_9dc5)
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
        }
    }

    fn add(&mut self, value: f32) {
        self.add_bytes(&value.to_bits().to_le_bytes());
    }

    fn add_samples(&mut self, samples: &[Complex32]) {
        for sample in samples {
            self.add(sample.re);
            self.add(sample.im);
        }
    }
}
