//! Self-test of the odometer: a radar with two receivers passes three reflectors.

use super::{Fnv1a, Lcg};
use crate::motion::{
    Antennas, Odometer, Progress, SampleError, Setup, SetupError, Step, TrackerSettings,
};
use crate::{Complex32, SPEED_OF_LIGHT_M_S, Turns};

/// Number of pulses of the odometer self-test.
pub const ODOMETER_PULSES: usize = 16;

const CHANNELS: usize = 2;
const FREQUENCIES: usize = 32;
const BINS: usize = 128;
const TARGETS: usize = 4;

const SETUP: Setup = Setup {
    num_frequencies: FREQUENCIES as u16,
    range_length: BINS as u16,
    start_hz: 77e9,
    step_hz: 31.25e6,
    side_lobe_db: 45.0,
    ranges_m: [0.5, 4.75],
    guard: 2,
    training: 8,
    rank: 0.6,
    false_alarm_probability: 1e-4,
    least_snr_db: 10.0,
    follow: TrackerSettings {
        gate_cells: 0.5,
        acceleration_cells: 0.01,
        apart_cells: 1.5,
        seen: 3,
        within: 4,
        bridge: 5,
    },
};
const ANTENNAS: Antennas<'static> = Antennas {
    transmitters_m: &[[-0.01, 0.0]],
    receivers_m: &[[0.0, 0.0], [0.001_9, 0.0]],
    wavelength_m: 0.003_87,
};
const PLACES_M: [[f64; 2]; 3] = [[-0.6, 1.1], [0.75, 2.0], [1.25, 3.5]];

/// Self-test of [`Odometer`]: [`ODOMETER_PULSES`] pulses. Intended as a static.
#[derive(Clone, Debug)]
pub struct OdometerSelfTest {
    odometer: Odometer<TARGETS, CHANNELS, FREQUENCIES, BINS>,
}

/// Step that rejected valid data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OdometerSelfTestError {
    /// The setup was rejected.
    Setup(SetupError),
    /// Samples were rejected.
    Samples(SampleError),
    /// A pulse gave no step, or too few steps have an increment.
    Steps,
}

impl OdometerSelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers.
    pub const fn new() -> Self {
        Self {
            odometer: Odometer::new(),
        }
    }

    /// Run the test and return the checksum of all steps.
    ///
    /// # Errors
    /// None in a correct build.
    pub fn run(&mut self) -> Result<u32, OdometerSelfTestError> {
        let odometer = &mut self.odometer;
        odometer
            .configure(&SETUP, &ANTENNAS)
            .map_err(OdometerSelfTestError::Setup)?;
        odometer.start(0);
        let mut checksum = Fnv1a::new();
        let mut noise = Lcg(4);
        let mut increments = 0;
        for n in 0..ODOMETER_PULSES as u32 {
            for (c, receiver) in ANTENNAS.receivers_m.iter().enumerate() {
                let samples = samples(n, receiver, &mut noise);
                odometer
                    .push(n, c, 2.0, samples.into_iter())
                    .map_err(OdometerSelfTestError::Samples)?;
            }
            let step = loop {
                match odometer.work() {
                    Progress::Busy => {}
                    Progress::Step(step) => break step,
                    Progress::Idle => return Err(OdometerSelfTestError::Steps),
                }
            };
            increments += usize::from(step.moved.is_some());
            add(&mut checksum, &step);
        }
        // Targets are confirmed in the third pulse.
        match increments == ODOMETER_PULSES - 3 {
            true => Ok(checksum.0),
            false => Err(OdometerSelfTestError::Steps),
        }
    }
}

impl Default for OdometerSelfTest {
    fn default() -> Self {
        Self::new()
    }
}

fn add(checksum: &mut Fnv1a, step: &Step) {
    checksum.add_bytes(&[step.pulse as u8, step.targets as u8, step.echoes as u8]);
    let Some(moved) = &step.moved else { return };
    let [x, y] = moved.increment.moved_m;
    for value in [x, y, moved.increment.turn_rad, moved.residual_m] {
        checksum.add_bytes(&value.to_bits().to_le_bytes());
    }
    checksum.add_bytes(&[moved.targets as u8, moved.doubtful as u8]);
}

/// Samples of one receiver in pulse `n`: moved half a millimetre per pulse, phases referenced to two metres.
fn samples(n: u32, receiver: &[f64; 2], noise: &mut Lcg) -> [Complex32; FREQUENCIES] {
    let x_m = f64::from(n) * 0.000_5;
    let leg = |place: &[f64; 2], antenna: &[f64; 2]| {
        let (x, y) = (place[0] - antenna[0] - x_m, place[1] - antenna[1]);
        libm::sqrt(x * x + y * y)
    };
    let mut samples = [Complex32::ZERO; FREQUENCIES];
    for place in &PLACES_M {
        let path_m = leg(place, &ANTENNAS.transmitters_m[0]) + leg(place, receiver) - 2.0;
        let turns = |hz: f64| Turns::from_f64(-hz * (path_m / SPEED_OF_LIGHT_M_S));
        let (mut phase, step) = (turns(SETUP.start_hz), turns(SETUP.step_hz));
        for sample in &mut samples {
            *sample += phase.phasor();
            phase = phase.plus(step);
        }
    }
    samples.map(|sample| sample + Complex32::new(noise.next(), noise.next()) * 0.0625)
}

impl core::fmt::Display for OdometerSelfTestError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Setup(error) => write!(f, "odometer self-test: {error}"),
            Self::Samples(error) => write!(f, "odometer self-test: {error}"),
            Self::Steps => f.write_str("odometer self-test: expected increments are missing"),
        }
    }
}

impl core::error::Error for OdometerSelfTestError {}
