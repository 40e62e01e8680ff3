//! Simulated measurements of a known track by a radar at 1 kHz, a receiver at 5 Hz and an inertial solution at 20 Hz.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_model::monitor::Silent;
use subaperture_navigation::fusion::{
    Assumed, Fused, Increment, Inertial, Inputs, Model, Position, fuse,
};

/// Pulse repetition frequency, Hz.
pub(crate) const PULSES_HZ: f64 = 1000.0;

pub(crate) fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (a, b) = (1.0 - uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

/// Gaussian noise with a standard deviation for each axis.
pub(crate) fn noise(random: &mut ChaCha8Rng, sigma: DVec3) -> DVec3 {
    DVec3::new(gaussian(random), gaussian(random), gaussian(random)) * sigma
}

/// Position at time `t`: about 1 m/s along a curve with a sway of 3 mm, and 5 cm up and down.
pub(crate) fn place(t: f64) -> DVec3 {
    DVec3::new(
        t + 0.6 * (TAU * t / 17.0).sin(),
        4.0 * (TAU * t / 45.0).sin() + 0.003 * (TAU * 1.3 * t).sin(),
        0.05 * (TAU * t / 20.0).sin(),
    )
}

pub(crate) fn velocity(t: f64) -> DVec3 {
    DVec3::new(
        1.0 + 0.6 * TAU / 17.0 * (TAU * t / 17.0).cos(),
        4.0 * TAU / 45.0 * (TAU * t / 45.0).cos() + 0.003 * TAU * 1.3 * (TAU * 1.3 * t).cos(),
        0.05 * TAU / 20.0 * (TAU * t / 20.0).cos(),
    )
}

/// Heading at time `t`, radians: 0.5 rad along the curve, and 5 degrees of oscillation.
pub(crate) fn heading(t: f64) -> f64 {
    0.5 * (TAU * t / 45.0).cos() + 0.087 * (TAU * t / 7.3).sin()
}

pub(crate) fn turn_rate(t: f64) -> f64 {
    -0.5 * TAU / 45.0 * (TAU * t / 45.0).sin() + 0.087 * TAU / 7.3 * (TAU * t / 7.3).cos()
}

pub(crate) fn body(t: f64) -> DMat3 {
    DMat3::from_rotation_z(heading(t))
}

/// True parameters and noise of the sensors.
#[derive(Clone)]
pub(crate) struct Sensors {
    pub(crate) seconds: f64,
    /// Standard deviations of an increment along x and y, metres, and of its turn, radians.
    pub(crate) step: [f64; 3],
    /// Relative scale error of x.
    pub(crate) scale: f64,
    pub(crate) position: DVec3,
    pub(crate) inertial_position: f64,
    pub(crate) inertial_velocity: f64,
    pub(crate) inertial_heading: f64,
    /// Priors of the fusion; the fields below are the true values.
    pub(crate) model: Model,
    pub(crate) receiver_clock_s: f64,
    pub(crate) inertial_clock_s: f64,
    pub(crate) squint: f64,
    pub(crate) receiver_arm: DVec3,
    pub(crate) inertial_arm: DVec3,
    /// Times without increments, positions and inertial states, seconds.
    pub(crate) out: [Option<[f64; 2]>; 3],
}

/// Sensors with increment noise of 3 um and 3 urad, a scale error of 2 mm/m, and position errors of 0.1 m.
pub(crate) fn sensors() -> Sensors {
    Sensors {
        seconds: 60.0,
        step: [3e-6, 3e-6, 3e-6],
        scale: 2e-3,
        position: DVec3::new(0.1, 0.1, 0.2),
        inertial_position: 1e-3,
        inertial_velocity: 3e-3,
        inertial_heading: 3e-4,
        model: Model {
            acceleration: 0.5,
            acceleration_up: 0.01,
            inertial_position: [0.5, 5e-4],
            inertial_velocity: [0.02, 1e-3],
            inertial_heading: 1e-4,
            scale: 2e-3,
            scale_time_s: 1000.0,
            squint_rad: Assumed {
                value: 0.0,
                sigma: 0.02,
            },
            ..Model::default()
        },
        receiver_clock_s: 0.0,
        inertial_clock_s: 0.0,
        squint: 0.01,
        receiver_arm: DVec3::ZERO,
        inertial_arm: DVec3::ZERO,
        out: [None; 3],
    }
}

pub(crate) struct Measurements {
    pub(crate) increments: Vec<Increment>,
    pub(crate) positions: Vec<Position>,
    pub(crate) inertial: Vec<Inertial>,
}

impl Measurements {
    pub(crate) fn inputs(&self) -> Inputs<'_> {
        Inputs {
            increments: &self.increments,
            positions: &self.positions,
            inertial: &self.inertial,
        }
    }
}

impl Sensors {
    pub(crate) fn out(&self, which: usize, t: f64) -> bool {
        self.out[which].is_some_and(|[from, to]| (from..to).contains(&t))
    }

    pub(crate) fn measure(&self, seed: u64) -> Measurements {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let random = &mut random;
        let mut increments = Vec::new();
        let covariance = DMat3::from_diagonal(DVec3::from(self.step.map(|sigma| sigma * sigma)));
        for n in 0..(self.seconds * PULSES_HZ) as usize {
            let (from_s, to_s) = (n as f64 / PULSES_HZ, (n + 1) as f64 / PULSES_HZ);
            let moved = body(from_s).transpose() * (place(to_s) - place(from_s));
            let error: [f64; 3] = self.step.map(|sigma| sigma * gaussian(random));
            if !self.out(0, from_s) {
                increments.push(Increment {
                    from_s,
                    to_s,
                    moved_m: [
                        (moved.x + error[0]) / (1.0 - self.scale),
                        moved.y + error[1],
                    ],
                    turned_rad: heading(to_s) - heading(from_s) + error[2],
                    covariance,
                });
            }
        }
        let mut positions = Vec::new();
        for n in 0..=(self.seconds * 5.0) as usize {
            // Between two edges of increments.
            let t = n as f64 / 5.0 + 0.0003;
            let at = place(t) + body(t) * self.receiver_arm + noise(random, self.position);
            if !self.out(1, t) && t < self.seconds {
                positions.push(Position {
                    time_s: t + self.receiver_clock_s,
                    position_m: at,
                    sigma_m: self.position,
                    velocity_m_s: None,
                });
            }
        }
        // Drifts as random walks with steps of 0.01 s.
        let model = &self.model;
        let mut b = noise(random, DVec3::splat(model.inertial_position[0]));
        let mut c = noise(random, DVec3::splat(model.inertial_velocity[0]));
        let mut h = 0.0;
        let mut inertial = Vec::new();
        for n in 0..(self.seconds * 100.0) as usize {
            let t = n as f64 / 100.0;
            let (place_noise, velocity_noise) = (
                noise(random, DVec3::splat(self.inertial_position)),
                noise(random, DVec3::splat(self.inertial_velocity)),
            );
            let heading_noise = self.inertial_heading * gaussian(random);
            if n % 5 == 2 && !self.out(2, t) {
                let arm = body(t) * self.inertial_arm;
                let end = velocity(t) + turn_rate(t) * DVec3::Z.cross(arm);
                inertial.push(Inertial {
                    time_s: t + self.inertial_clock_s,
                    position_m: Some([
                        place(t) + arm + b + place_noise,
                        DVec3::splat(self.inertial_position),
                    ]),
                    velocity_m_s: Some([
                        end + c + velocity_noise,
                        DVec3::splat(self.inertial_velocity),
                    ]),
                    heading_rad: Some([
                        heading(t) - self.squint + h + heading_noise,
                        self.inertial_heading,
                    ]),
                    roll_pitch_rad: [0.0; 2],
                });
            }
            b += c * 0.01 + noise(random, DVec3::splat(model.inertial_position[1] * 0.1));
            c += noise(random, DVec3::splat(model.inertial_velocity[1] * 0.1));
            h += model.inertial_heading * 0.1 * gaussian(random);
        }
        Measurements {
            increments,
            positions,
            inertial,
        }
    }

    pub(crate) fn fused(&self, seed: u64) -> Fused {
        let measured = self.measure(seed);
        fuse(&measured.inputs(), &self.model, &Silent).unwrap()
    }
}
