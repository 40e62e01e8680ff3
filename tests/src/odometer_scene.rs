//! A radar with several receivers passing reflectors in a plane: its samples by plain float64 sums over scatterers, and its true motion.

use std::f64::consts::TAU;

use num_complex::Complex32;
use subaperture::geometry::SceneFrame;
use subaperture::glam::{DVec2, DVec3};
use subaperture::module::link::MotionRun;
use subaperture::phase_history::{
    Channel, Channels, Collection, InMemory, PhaseHistory, Pulse, Sweep,
};
use subaperture_core::Sc16;
use subaperture_core::link::{Increment, Motion};
use subaperture_core::motion::{Antennas, Odometer, Progress, Setup, Step, TrackerSettings};

use crate::random::Random;

const C_M_S: f64 = 299_792_458.0;

/// Frequencies per pulse.
pub const FREQUENCIES: usize = 64;
/// Points of the range transform.
pub const BINS: usize = 256;
/// Band from 77 to 78 GHz.
pub const START_HZ: f64 = 77e9;
/// Frequency step; ranges are ambiguous after 9.6 m.
pub const STEP_HZ: f64 = 1e9 / 64.0;

/// Wavelength at mid-band, metres.
pub fn wavelength_m() -> f64 {
    C_M_S / (START_HZ + 0.5 * (FREQUENCIES - 1) as f64 * STEP_HZ)
}

/// Settings of the odometer.
pub fn setup() -> Setup {
    Setup {
        num_frequencies: FREQUENCIES as u16,
        range_length: BINS as u16,
        start_hz: START_HZ,
        step_hz: STEP_HZ,
        side_lobe_db: 50.0,
        ranges_m: [1.0, 9.0],
        guard: 3,
        training: 12,
        rank: 0.6,
        false_alarm_probability: 1e-5,
        least_snr_db: 10.0,
        follow: TrackerSettings::default(),
    }
}

/// Position, metres, and counterclockwise angle, radians.
pub type Pose = ([f64; 2], f64);

/// Antennas, reflectors and noise.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Positions in the array's frame, whose origin is midway between the means of the transmitters and of the receivers, metres.
    pub transmitters_m: Vec<[f64; 2]>,
    /// Positions of the receivers in the same frame, metres.
    pub receivers_m: Vec<[f64; 2]>,
    /// Positions and amplitudes.
    pub reflectors: Vec<([f64; 2], f64)>,
    /// RMS of a sample's noise.
    pub noise: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// Path to which samples are compensated, metres.
    pub reference_path_m: f64,
    /// Whether samples are an eighth of their value, rounded to 16 bits.
    pub short: bool,
}

impl Scene {
    /// One transmitter and `receivers` receivers half a wavelength apart; four reflectors from 2.4 to 6.9 m, all resolved in range.
    pub fn new(receivers: usize) -> Self {
        let half_m = 0.5 * wavelength_m();
        let middle = 0.5 * (receivers - 1) as f64;
        let place = |i: usize| [0.01 + (i as f64 - middle) * half_m, 0.0];
        Self {
            transmitters_m: vec![[-0.01, 0.0]],
            receivers_m: (0..receivers).map(place).collect(),
            reflectors: vec![
                ([-0.9, 2.25], 1.0),
                ([0.6, 3.5], 1.2),
                ([2.1, 4.7], 0.9),
                ([-2.6, 6.4], 1.1),
            ],
            noise: 0.0,
            seed: 1,
            reference_path_m: 0.0,
            short: false,
        }
    }

    /// Set the noise for which a reflector of amplitude 1 has this SNR in its range cell.
    #[must_use]
    pub fn with_snr_db(mut self, snr_db: f64, seed: u64) -> Self {
        // Taylor's window of 50 dB has a loss of 1.6 dB: 44 of 64 samples remain.
        self.noise = (44.0 / 10f64.powf(0.1 * snr_db)).sqrt();
        self.seed = seed;
        self
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.transmitters_m.len() * self.receivers_m.len()
    }

    /// Antennas in the core's type.
    pub fn antennas(&self) -> Antennas<'_> {
        Antennas {
            transmitters_m: &self.transmitters_m,
            receivers_m: &self.receivers_m,
            wavelength_m: wavelength_m(),
        }
    }

    /// Samples of a pulse by channel.
    pub fn pulse(&self, n: usize) -> Vec<Vec<Complex32>> {
        let (at_m, heading_rad) = pose(n);
        let (sin, cos) = heading_rad.sin_cos();
        let leg_m = |place: &[f64; 2], [x, y]: &[f64; 2]| {
            let antenna = [at_m[0] + cos * x - sin * y, at_m[1] + sin * x + cos * y];
            (place[0] - antenna[0]).hypot(place[1] - antenna[1])
        };
        let mut random = Random(self.seed.wrapping_add((n as u64) << 20));
        let mut all = Vec::new();
        for transmitter in &self.transmitters_m {
            for receiver in &self.receivers_m {
                let sample = |k: usize| {
                    let hz = START_HZ + k as f64 * STEP_HZ;
                    let (mut re, mut im) = (0.0, 0.0);
                    for (place, amplitude) in &self.reflectors {
                        let path_m = leg_m(place, transmitter) + leg_m(place, receiver);
                        let turns = hz * (path_m - self.reference_path_m) / C_M_S;
                        let (s, c) = (TAU * turns.fract()).sin_cos();
                        (re, im) = (re + amplitude * c, im - amplitude * s);
                    }
                    let part = self.noise * std::f64::consts::FRAC_1_SQRT_2;
                    let [a, b] = random.gaussians();
                    let z = Complex32::new((re + part * a) as f32, (im + part * b) as f32);
                    match self.short {
                        true => Sc16::from_complex32(z * 0.125).0.to_complex32(),
                        false => z,
                    }
                };
                all.push((0..FREQUENCIES).map(sample).collect());
            }
        }
        all
    }
}

/// The scene as the library's recordings.
impl Scene {
    /// Pulses of each channel with the true antenna positions.
    ///
    /// # Panics
    /// If there are no pulses.
    pub fn recorded(&self, pulses: usize) -> Vec<InMemory> {
        let mut all: Vec<(Vec<Pulse>, Vec<Complex32>)> = vec![Default::default(); self.channels()];
        for n in 0..pulses {
            let (at_m, heading_rad) = pose(n);
            let turn = DVec2::from_angle(heading_rad);
            let place = |arm_m: &[f64; 2]| {
                let own = DVec2::from_array(at_m) + turn.rotate(DVec2::from_array(*arm_m));
                own.extend(0.0)
            };
            let pairs = (self.transmitters_m.iter())
                .flat_map(|t| self.receivers_m.iter().map(move |r| [place(t), place(r)]));
            for (((pulses, samples), [t, r]), own) in all.iter_mut().zip(pairs).zip(self.pulse(n)) {
                pulses.push(Pulse {
                    time_s: n as f64 * 1e-3,
                    transmitter_m: t,
                    receiver_m: r,
                    reference_m: DVec3::new(0.0, 4.0, 0.0),
                    reference_path_m: self.reference_path_m,
                    start_hz: START_HZ,
                    step_hz: STEP_HZ,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                });
                samples.extend(own);
            }
        }
        let each = all.into_iter().map(|(pulses, samples)| {
            let collection = Collection {
                name: "plain sums".to_owned(),
                num_samples: FREQUENCIES,
                pulses,
                frame: SceneFrame::Local,
                extent: None,
                timed: true,
            };
            InMemory::new(collection, samples).expect("pulses of finite samples")
        });
        each.collect()
    }

    /// Run of the odometer of a module on recordings of the channels, with samples from there or from its front end.
    pub fn motion_run<'a>(
        &'a self,
        channels: &'a [&'a dyn PhaseHistory],
        from_front_end: bool,
    ) -> MotionRun<'a> {
        MotionRun {
            setup: setup(),
            transmitters_m: &self.transmitters_m,
            receivers_m: &self.receivers_m,
            channels,
            from_front_end,
        }
    }

    /// Increments of the core on this machine.
    ///
    /// # Panics
    /// If the core refuses the pulses, or most give no increment.
    pub fn increments(&self, pulses: usize) -> Vec<Increment> {
        let mut odometer = Box::new(Odometer::<8, 4, FREQUENCIES, BINS>::new());
        odometer
            .configure(&setup(), &self.antennas())
            .expect("settings of this scene");
        assert!(odometer.start(0), "it is configured");
        let mut all = Vec::new();
        for n in 0..pulses {
            for (c, samples) in self.pulse(n).into_iter().enumerate() {
                odometer
                    .push(n as u32, c, self.reference_path_m, samples.into_iter())
                    .expect("a channel of the pulse");
            }
            let step = loop {
                match odometer.work() {
                    Progress::Busy => {}
                    Progress::Idle => panic!("pulse {n} gave no increment"),
                    Progress::Step(step) => break step,
                }
            };
            all.push(as_sent(&step));
        }
        let moved = all.iter().filter(|own| own.motion.is_some()).count();
        assert!(2 * moved > pulses, "{moved} of {pulses}");
        all
    }

    /// All channels of the recording.
    ///
    /// # Panics
    /// As [`Scene::recorded`].
    pub fn channels_of(&self, pulses: usize) -> Channels<'static> {
        let boxed = self.recorded(pulses).into_iter().enumerate();
        let boxed = boxed.map(|(c, history)| {
            let history: Box<dyn PhaseHistory> = Box::new(history);
            (Channel::new(format!("{c}")), history)
        });
        Channels::new(boxed.collect()).expect("channels of as many pulses")
    }
}

/// A step as the link transmits it.
pub fn as_sent(step: &Step) -> Increment {
    Increment {
        pulse: step.pulse,
        since: step.since,
        targets: step.targets,
        echoes: step.echoes,
        motion: step.moved.map(|moved| Motion {
            moved_m: moved.increment.moved_m,
            turn_rad: moved.increment.turn_rad,
            residual_m: moved.residual_m as f32,
            targets: moved.targets as u16,
            doubtful: moved.doubtful as u16,
        }),
    }
}

/// Pose at pulse `n`: 0.7 mm per pulse along x, and small changes in the other components.
pub fn pose(n: usize) -> Pose {
    let u = n as f64 / 300.0;
    let sway = |cycles: f64| (TAU * cycles * u).sin();
    ([0.21 * u, 0.002 * sway(2.0)], 0.01 * sway(1.5))
}

/// Increment between two poses: along the array and ahead in the first pose's frame, metres, and the rotation, radians.
pub fn between(from: Pose, to: Pose) -> ([f64; 2], f64) {
    let (sin, cos) = from.1.sin_cos();
    let [x, y] = [to.0[0] - from.0[0], to.0[1] - from.0[1]];
    ([cos * x + sin * y, cos * y - sin * x], to.1 - from.1)
}
