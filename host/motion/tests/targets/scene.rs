//! Simulated echoes of any array in a plane, by plain sums over scatterers, independent of the code under test.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use num_complex::{Complex32, Complex64};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{
    Channel, Channels, Collection, InMemory, PhaseHistory, Pulse, Sweep,
};

pub(crate) const C_M_S: f64 = 299_792_458.0;

/// Position and heading of a radar in a plane.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Truth {
    pub(crate) at_m: DVec2,
    pub(crate) heading_rad: f64,
}

#[derive(Clone)]
pub(crate) struct Radar {
    pub(crate) start_hz: f64,
    pub(crate) step_hz: f64,
    pub(crate) samples: usize,
    pub(crate) transmitters_m: Vec<DVec2>,
    pub(crate) receivers_m: Vec<DVec2>,
}

impl Radar {
    pub(crate) fn middle_hz(&self) -> f64 {
        self.start_hz + 0.5 * (self.samples - 1) as f64 * self.step_hz
    }
}

/// 1.1 to 1.7 GHz in steps of 4 MHz, one transmitter, two receivers half a wavelength of 1.4 GHz apart.
pub(crate) fn l_band() -> Radar {
    Radar {
        start_hz: 1.1e9,
        step_hz: 4e6,
        samples: 151,
        transmitters_m: vec![DVec2::ZERO],
        receivers_m: vec![DVec2::new(0.2, 0.0), DVec2::new(0.307, 0.0)],
    }
}

/// 77 to 78 GHz in 256 samples, one transmitter, two receivers half a wavelength apart (Chim 2018, 7.5).
pub(crate) fn w_band() -> Radar {
    let step_hz = 1e9 / 256.0;
    let half_m = 0.5 * C_M_S / (77e9 + 127.5 * step_hz);
    Radar {
        start_hz: 77e9,
        step_hz,
        samples: 256,
        transmitters_m: vec![DVec2::new(-0.02, 0.0)],
        receivers_m: vec![DVec2::ZERO, DVec2::new(half_m, 0.0)],
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Reflector {
    /// Position in the first pulse, metres.
    pub(crate) at_m: DVec2,
    pub(crate) amplitude: f64,
    /// Motion per pulse in metres, and the range of pulses in which it moves: from the first of these on, before the second.
    pub(crate) step_m: DVec2,
    pub(crate) goes: [usize; 2],
    /// Acceleration from the first pulse on, metres a pulse squared.
    pub(crate) bend_m: DVec2,
}

impl Reflector {
    /// Position in pulse `n`, metres.
    pub(crate) fn in_pulse_m(&self, n: usize) -> DVec2 {
        let [from, to] = self.goes;
        let bent = self.bend_m * (0.5 * (n * n) as f64);
        self.at_m + self.step_m * n.clamp(from, to).saturating_sub(from) as f64 + bent
    }
}

/// Time from pulse to pulse, seconds.
pub(crate) const PERIOD_S: f64 = 1e-2;

/// Reflector that moves in all pulses, velocity in m/s.
pub(crate) fn moving(at_m: [f64; 2], velocity_m_s: [f64; 2], amplitude: f64) -> Reflector {
    Reflector {
        step_m: DVec2::from_array(velocity_m_s) * PERIOD_S,
        ..reflector(at_m[0], at_m[1], amplitude)
    }
}

pub(crate) fn reflector(x: f64, y: f64, amplitude: f64) -> Reflector {
    Reflector {
        at_m: DVec2::new(x, y),
        amplitude,
        step_m: DVec2::ZERO,
        goes: [0, usize::MAX],
        bend_m: DVec2::ZERO,
    }
}

pub(crate) fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (a, b) = (1.0 - uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

/// Recording of a radar on the track `truth` with the recorded track `recorded`, and noise of RMS `noise` per sample.
pub(crate) struct Recording<'a> {
    pub(crate) radar: &'a Radar,
    pub(crate) truth: &'a [Truth],
    pub(crate) recorded: &'a [Truth],
    pub(crate) reflectors: &'a [Reflector],
    pub(crate) noise: f64,
    pub(crate) seed: u64,
}

fn antenna(at: &Truth, arm_m: DVec2) -> DVec2 {
    at.at_m + DVec2::from_angle(at.heading_rad).rotate(arm_m)
}

impl Recording<'_> {
    /// Samples of each channel, pulse by pulse.
    pub(crate) fn collections(&self) -> Vec<(Channel, Collection, Vec<Complex32>)> {
        let mut random = random(self.seed);
        let mut all = Vec::new();
        for (t, t_arm) in self.radar.transmitters_m.iter().enumerate() {
            for (r, r_arm) in self.radar.receivers_m.iter().enumerate() {
                let mut pulses = Vec::new();
                let mut samples = Vec::new();
                for (n, (truth, recorded)) in self.truth.iter().zip(self.recorded).enumerate() {
                    let level = |p: DVec2| p.extend(0.0);
                    let [tx, rx] = [t_arm, r_arm].map(|arm| level(antenna(recorded, *arm)));
                    let reference_m = DVec3::new(0.0, 12.0, 0.0);
                    let pulse = Pulse {
                        time_s: n as f64 * PERIOD_S,
                        transmitter_m: tx,
                        receiver_m: rx,
                        reference_m,
                        reference_path_m: tx.distance(reference_m) + rx.distance(reference_m),
                        start_hz: self.radar.start_hz,
                        step_hz: self.radar.step_hz,
                        sweep: Sweep::AT_ONCE,
                        recorded_path_m: None,
                    };
                    for k in 0..self.radar.samples {
                        let hz = self.radar.start_hz + k as f64 * self.radar.step_hz;
                        let mut sum = Complex64::ZERO;
                        for reflector in self.reflectors {
                            let at_m = reflector.in_pulse_m(n);
                            let legs =
                                [t_arm, r_arm].map(|arm| at_m.distance(antenna(truth, *arm)));
                            let path_m = legs[0] + legs[1] - pulse.reference_path_m;
                            let turns = hz * path_m / C_M_S;
                            sum += Complex64::cis(-TAU * turns.fract()) * reflector.amplitude;
                        }
                        let part = self.noise * std::f64::consts::FRAC_1_SQRT_2;
                        sum += Complex64::new(gaussian(&mut random), gaussian(&mut random)) * part;
                        samples.push(Complex32::new(sum.re as f32, sum.im as f32));
                    }
                    pulses.push(pulse);
                }
                let name = format!("T{}R{}", t + 1, r + 1);
                let collection = Collection {
                    name: "plain sums".to_owned(),
                    num_samples: self.radar.samples,
                    pulses,
                    frame: SceneFrame::Local,
                    extent: None,
                    timed: true,
                };
                all.push((Channel::new(name), collection, samples));
            }
        }
        all
    }

    pub(crate) fn channels(&self) -> Channels<'static> {
        channels(self.collections())
    }
}

pub(crate) fn channels(all: Vec<(Channel, Collection, Vec<Complex32>)>) -> Channels<'static> {
    let boxed = all.into_iter().map(|(about, collection, samples)| {
        let history: Box<dyn PhaseHistory> = Box::new(InMemory::new(collection, samples).unwrap());
        (about, history)
    });
    Channels::new(boxed.collect()).unwrap()
}
