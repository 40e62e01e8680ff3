//! Built-in recordings of the self-test: a few scatterers by plain sums, with pseudo-random noise.

use glam::DVec3;
use num_complex::{Complex, Complex32, Complex64};
use subaperture_core::link::{ChipGrid, Encoding};
use subaperture_core::stream::{Patch, Setup};
use subaperture_core::{Window, motion, sweep};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{Collection, InMemory, Pulse, ReadError, Sweep};
use subaperture_signal::phase::phasor;

use crate::link::{Job, PulseSource, SweepBurst, SweepSource};

/// Linear congruential generator (Knuth, MMIX).
struct Random(u64);

impl Random {
    /// Number from -1/2 to 1/2.
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    /// Noise sample with parts from -1/2 to 1/2.
    fn sample(&mut self) -> Complex64 {
        Complex64::new(self.uniform(), self.uniform())
    }
}

/// Settings of the maps: sub-CPIs of 4 pulses.
const SETUP: Setup = Setup {
    num_pulses: 4,
    num_channels: 1,
    num_frequencies: 16,
    range_length: 32,
    doppler_length: 16,
    start_hz: 9.4e9,
    step_hz: 3e6,
};
/// Pulses: five sub-CPIs of 4 and one of 2.
const PULSES: usize = 22;

/// Two patches, with room for the interpolation kernel of the chips.
const PATCHES: [Patch; 2] = [
    Patch {
        centre_m: [3.0, -2.0, 0.5],
        range_reach: 7,
        doppler_reach: 7,
    },
    Patch {
        centre_m: [-4.0, 6.0, 0.0],
        range_reach: 7,
        doppler_reach: 7,
    },
];

/// A chip at the centre of each patch.
pub(super) const CHIPS: [ChipGrid; 2] = [
    ChipGrid {
        patch: 0,
        origin_m: [2.75, -2.25, 0.5],
        column_step_m: [0.125, 0.0, 0.0],
        row_step_m: [0.0, 0.125, 0.0],
        num_columns: 6,
        num_rows: 5,
    },
    ChipGrid {
        patch: 1,
        origin_m: [-4.25, 6.0, 0.0],
        column_step_m: [0.125, 0.0, 0.0],
        row_step_m: [0.0, 0.125, 0.0],
        num_columns: 4,
        num_rows: 3,
    },
];

/// Echo of scatterers with their amplitudes, in a pulse with antennas at `ends_m`.
fn echo(
    hz: f64,
    ends_m: [DVec3; 2],
    reference_path_m: f64,
    scatterers: &[(DVec3, f64)],
) -> Complex64 {
    let each = scatterers.iter().map(|(place_m, amplitude)| {
        let path_m = ends_m
            .map(|end_m| end_m.distance(*place_m))
            .iter()
            .sum::<f64>();
        phasor(-hz * (path_m - reference_path_m) / SPEED_OF_LIGHT_M_S) * amplitude
    });
    each.sum()
}

fn collection(name: &str, num_samples: u16, pulses: Vec<Pulse>) -> Collection {
    Collection {
        name: name.to_owned(),
        num_samples: num_samples.into(),
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    }
}

/// Number as complex float32.
fn narrow(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}

/// Pulses on a track 850 m from nine scatterers.
pub(super) fn recording() -> Result<InMemory, ReadError> {
    let mut random = Random(1);
    let scatterers: Vec<(DVec3, f64)> = (0..9)
        .map(|i| {
            let place_m = DVec3::new(16.0 * random.uniform(), 16.0 * random.uniform(), 0.0);
            (place_m, 1.0 / f64::from(1 + i))
        })
        .collect();
    let (mut pulses, mut samples) = (Vec::new(), Vec::new());
    for n in 0..PULSES {
        let along_m = 0.35 * n as f64 - 4.0;
        let transmitter_m = DVec3::new(800.0 - along_m * along_m / 900.0, along_m, 300.0);
        let receiver_m = transmitter_m + DVec3::new(0.0, 1.5, 0.0);
        let reference_path_m = transmitter_m.length() + receiver_m.length();
        for k in 0..SETUP.num_frequencies {
            let hz = SETUP.start_hz + f64::from(k) * SETUP.step_hz;
            let ends_m = [transmitter_m, receiver_m];
            let echo = echo(hz, ends_m, reference_path_m, &scatterers);
            samples.push(narrow((echo + random.sample() * 0.2) * 0.2));
        }
        pulses.push(Pulse {
            time_s: n as f64 * 1e-3,
            transmitter_m,
            receiver_m,
            reference_m: DVec3::ZERO,
            reference_path_m,
            start_hz: SETUP.start_hz,
            step_hz: SETUP.step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        });
    }
    InMemory::new(
        collection("selftest", SETUP.num_frequencies, pulses),
        samples,
    )
}

/// Job of the maps of a recording.
pub(super) fn job(recording: &InMemory, encoding: Encoding) -> Result<Job<'_>, ReadError> {
    let num_frequencies = SETUP.num_frequencies.into();
    Ok(Job {
        setup: SETUP,
        fast_weights: vec![1.0 / f32::from(SETUP.num_frequencies); num_frequencies],
        patches: PATCHES.to_vec(),
        pulses: PulseSource::new(&[recording], &[1.0; PULSES], encoding)?,
    })
}

/// Settings of the increments, from 77 to 78 GHz.
pub(super) const MOTION: motion::Setup = motion::Setup {
    num_frequencies: 64,
    range_length: 256,
    start_hz: 77e9,
    step_hz: 15.625e6,
    side_lobe_db: 50.0,
    ranges_m: [1.0, 9.0],
    guard: 3,
    training: 12,
    rank: 0.6,
    false_alarm_probability: 1e-5,
    least_snr_db: 10.0,
    follow: motion::TrackerSettings {
        gate_cells: 0.5,
        acceleration_cells: 0.01,
        apart_cells: 1.5,
        seen: 5,
        within: 8,
        bridge: 30,
    },
};

/// Pulses of the increments.
const MOTION_PULSES: usize = 12;
/// Half a wavelength at 77.5 GHz, metres.
const APART_M: f64 = 0.001934;
/// Transmitter in the array frame, metres.
pub(super) const TRANSMITTER_M: [[f64; 2]; 1] = [[-0.01, 0.0]];
/// Receivers in the array frame, metres.
pub(super) const RECEIVERS_M: [[f64; 2]; 2] =
    [[0.01 - 0.5 * APART_M, 0.0], [0.01 + 0.5 * APART_M, 0.0]];

/// Two receivers that move by 0.7 mm per pulse past four reflectors. Samples are multiples of `2^-15`, so that 16 bits
/// hold them exactly.
pub(super) fn channels() -> Result<Vec<InMemory>, ReadError> {
    let reflectors = [
        (DVec3::new(-0.9, 2.25, 0.0), 1.0),
        (DVec3::new(0.6, 3.5, 0.0), 1.2),
        (DVec3::new(2.1, 4.7, 0.0), 0.9),
        (DVec3::new(-2.6, 6.4, 0.0), 1.1),
    ];
    let mut random = Random(2);
    let each = RECEIVERS_M.map(|receiver_m| {
        let (mut pulses, mut samples) = (Vec::new(), Vec::new());
        for n in 0..MOTION_PULSES {
            let place_m = |[x, y]: [f64; 2]| DVec3::new(x + 7e-4 * n as f64, y, 0.0);
            let ends_m = [place_m(TRANSMITTER_M[0]), place_m(receiver_m)];
            for k in 0..MOTION.num_frequencies {
                let hz = MOTION.start_hz + f64::from(k) * MOTION.step_hz;
                let z = echo(hz, ends_m, 0.0, &reflectors) + random.sample() * 0.1;
                let counts = z * (0.125 * 32768.0);
                samples.push(narrow(
                    Complex64::new(counts.re.round(), counts.im.round()) / 32768.0,
                ));
            }
            pulses.push(Pulse {
                time_s: n as f64 * 1e-3,
                transmitter_m: ends_m[0],
                receiver_m: ends_m[1],
                reference_m: DVec3::new(0.0, 4.0, 0.0),
                reference_path_m: 0.0,
                start_hz: MOTION.start_hz,
                step_hz: MOTION.step_hz,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            });
        }
        InMemory::new(
            collection("selftest", MOTION.num_frequencies, pulses),
            samples,
        )
    });
    each.into_iter().collect()
}

/// Settings of the range profiles: 20 carriers from 1.1 GHz.
pub(super) const SWEEP: sweep::Setup = sweep::Setup {
    carriers: 20,
    period: 8,
    samples: 64,
    bins: 64,
    start_hz: 1.1e9,
    step_hz: 4e6,
};

/// Weights of the carriers.
pub(super) fn carrier_weights() -> Vec<f32> {
    let mut weights = vec![0.0; SWEEP.carriers.into()];
    let window = Window::Taylor { side_lobe_db: 45.0 };
    window.fill(&mut weights).expect("side lobes of 45 dB");
    weights
}

/// One sweep of a stepped-frequency radar over three scatterers.
pub(super) struct Bursts;

impl Bursts {
    pub(super) fn at(carrier: u16) -> SweepBurst {
        let mut random = Random(3 + u64::from(carrier));
        let hz = SWEEP.start_hz + f64::from(carrier) * SWEEP.step_hz;
        let scatterers = [(1.0, 0.4), (6.3, 0.5), (16.0, 0.39)];
        let each = scatterers.iter().map(|(range_m, amplitude)| {
            phasor(-hz * 2.0 * range_m / SPEED_OF_LIGHT_M_S) * *amplitude
        });
        let response: Complex64 = each.sum();
        let start = random.uniform();
        let pair = |i: u32| {
            let sent = phasor(f64::from(i) / f64::from(SWEEP.period) + start) * 12_000.0;
            [sent, sent * response].map(|z| {
                let z = z + random.sample() * 6.0;
                Complex::new(z.re.round() as i16, z.im.round() as i16)
            })
        };
        SweepBurst {
            carrier,
            samples: (0..SWEEP.samples).map(pair).collect(),
            lost: Vec::new(),
        }
    }
}

impl SweepSource for Bursts {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        Ok(sweep == 0)
    }

    fn burst(
        &mut self,
        _sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError> {
        if index >= usize::from(SWEEP.carriers) {
            return Ok(false);
        }
        *burst = Self::at(index as u16);
        Ok(true)
    }
}
