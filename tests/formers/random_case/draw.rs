//! Random cases from seeds: sizes are uniform in the logarithm, from a wavelength to the scale of an orbit.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use num_complex::Complex64;
use subaperture::signal::window::Window;
use subaperture_tests::random;

use super::{Antennas, Case, LIGHT_M_S, Plane, Point, Shape, Track};

/// Random numbers from a seed.
#[derive(Clone, Debug)]
pub(super) struct Random(random::Random);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(random::Random(seed))
    }

    /// 64 random bits.
    pub(super) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform in [from, to).
    pub(super) fn even(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the logarithm.
    pub(super) fn logarithmic(&mut self, from: f64, to: f64) -> f64 {
        self.even(from.ln(), to.ln()).exp()
    }

    /// Integer from `from` to `to`, both included, uniform in the logarithm.
    pub(super) fn count(&mut self, from: usize, to: usize) -> usize {
        (self.logarithmic(from as f64, to as f64 + 1.0) as usize).clamp(from, to)
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.even(0.0, 1.0) < probability
    }

    /// Normal with mean 0 and variance 1 (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.even(0.0, 1.0)).ln()).sqrt();
        radius * (TAU * self.even(0.0, 1.0)).cos()
    }

    /// A unit vector, uniform on the sphere.
    pub(super) fn direction(&mut self) -> DVec3 {
        let z = self.even(-1.0, 1.0);
        let (sin, cos) = self.even(0.0, TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    fn of<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[(self.bits() % choices.len() as u64) as usize].clone()
    }
}

/// Maximum of terms of the sum over a case's pixels, pulses and samples: some 20 ms. One case in 40 has ten times as many.
const MAX_TERMS: f64 = 4e6;

/// The case of a seed.
pub(crate) fn draw(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let r = &mut random;
    let centre_hz = r.logarithmic(0.3e9, 80e9);
    let wavelength_m = LIGHT_M_S / centre_hz;
    let fraction = r.logarithmic(0.005, 0.6);
    let num_samples = match r.chance(0.1) {
        true => r.count(1, 8),
        false => r.count(8, 128),
    };
    let num_pulses = match r.chance(0.1) {
        true => r.count(1, 12),
        false => r.count(12, 400),
    };
    let terms = MAX_TERMS * if r.chance(1.0 / 40.0) { 10.0 } else { 1.0 };
    let most = (terms / (num_samples * num_pulses) as f64).clamp(4.0, 4e4);
    let counts = match r.chance(0.15) {
        true => {
            let line = r.count(1, (most as usize).min(300));
            r.of(&[[1, 1], [1, line], [line, 1]])
        }
        false => {
            let side = most.sqrt();
            let stretch = r.logarithmic(0.4, 2.5);
            [side / stretch, side * stretch].map(|most| r.count(2, (most as usize).clamp(2, 200)))
        }
    };
    let step_hz = centre_hz * fraction / num_samples as f64;
    let resolution_m = LIGHT_M_S / (2.0 * centre_hz * fraction);
    let sane = r.chance(0.3);

    // The size of the scene follows from pixels of about the range resolution. The distance to it is between its own size and a thousand
    // times that.
    let finer = r.logarithmic(0.2, 1.5);
    let row_step_m = resolution_m.min(3.0 * wavelength_m * num_pulses as f64) * finer;
    let column_step_m = row_step_m * r.logarithmic(0.3, 3.0);
    let half_m = (row_step_m * counts[0] as f64).hypot(column_step_m * counts[1] as f64) / 2.0;
    let far = match sane {
        true => r.logarithmic(6.0, 1000.0),
        false => r.logarithmic(0.7, 1000.0),
    };
    let range_m = (half_m * far).max(3.0 * wavelength_m);
    let mut towards = r.direction();
    if r.chance(0.5) {
        // From the side, as from an aircraft.
        towards.z = r.even(0.05, 0.8);
        towards = towards.normalize();
    }
    let middle_m = towards * range_m;
    let along = match r.chance(0.6) {
        // Broadside.
        true => {
            let (across, angle) = (towards.any_orthonormal_vector(), r.even(0.0, TAU));
            across * angle.cos() + towards.cross(across) * angle.sin()
        }
        false => r.direction(),
    };
    // From the width of a beam to a full circle; in half of the cases about as long as azimuth resolution equal to that in range needs.
    let angle = match r.chance(0.5) {
        true => (wavelength_m / (2.0 * resolution_m)).clamp(1e-4, 1.5) * r.logarithmic(0.3, 3.0),
        false => r.logarithmic(1e-3, 2.0),
    };
    let length_m = range_m * angle;
    let track = Track {
        shape: shape(r, sane),
        middle_m,
        along,
        length_m,
        amplitude_m: wavelength_m * r.logarithmic(0.003, 30.0),
        antennas: antennas(r, sane, range_m, length_m, wavelength_m),
        reference_m: match r.even(0.0, 1.0) {
            u if u < 0.7 => 0.0,
            u if u < 0.9 => r.normal() * half_m,
            _ => f64::INFINITY,
        },
        seed: r.bits(),
    };
    let plane = plane(r, sane, &track, counts, [row_step_m, column_step_m], half_m);
    let mut case = Case {
        seed,
        track,
        num_pulses,
        start_hz: centre_hz * (1.0 - fraction / 2.0),
        step_hz,
        num_samples,
        plane,
        points: Vec::new(),
        noise: 0.0,
        windows: [(); 2].map(|()| window(r)),
        bound_db: match sane {
            true => r.of(&[-40.0, -50.0, -60.0, -60.0, -60.0, -70.0, -80.0]),
            false => r.even(-100.0, -30.0).round(),
        },
        sane,
    };
    scatter(r, &mut case, half_m);
    if sane || r.chance(0.3) {
        case.noise = r.logarithmic(1e-3, 1.0);
    }
    case
}

fn shape(r: &mut Random, sane: bool) -> Shape {
    let kind = match sane {
        true => r.even(0.0, 3.0),
        false => r.even(0.0, 10.0),
    };
    match kind as u32 {
        0 => Shape::Straight,
        1 => Shape::Curved(r.logarithmic(1e-3, 0.5)),
        2 if sane => Shape::Circle(r.logarithmic(0.3, 30.0)),
        2 => Shape::Circle(r.logarithmic(1.0, 360.0)),
        3 => Shape::Corner(r.even(-0.8, 0.8), r.even(-150.0, 150.0)),
        4 => Shape::Sway(r.logarithmic(0.3, 40.0)),
        5 => Shape::Jitter,
        6 => Shape::RoughStretch(r.even(-0.9, 0.8)),
        7 => Shape::StopAndGo(r.count(2, 9)),
        8 => Shape::Gap(r.even(-0.9, 0.9)),
        _ => Shape::Outlier(r.even(-1.0, 1.0)),
    }
}

fn antennas(
    r: &mut Random,
    sane: bool,
    range_m: f64,
    length_m: f64,
    wavelength_m: f64,
) -> Antennas {
    match r.even(0.0, 1.0) {
        u if u < 0.6 => Antennas::Monostatic,
        u if u < 0.75 => Antennas::Apart(r.direction() * range_m * r.logarithmic(1e-4, 1.0)),
        u if u < 0.85 => Antennas::Still(r.direction() * range_m * r.logarithmic(0.7, 3.0)),
        _ if sane => Antennas::Monostatic,
        _ => {
            let apart_m = r.logarithmic(0.3 * wavelength_m, length_m.max(wavelength_m));
            Antennas::InTurn(r.count(2, 8), r.direction() * apart_m)
        }
    }
}

fn plane(
    r: &mut Random,
    sane: bool,
    track: &Track,
    counts: [usize; 2],
    steps: [f64; 2],
    half_m: f64,
) -> Plane {
    let turn_deg = match r.chance(0.5) {
        true => [0.0; 3],
        false => [
            r.even(-180.0, 180.0),
            r.even(-90.0, 90.0),
            r.even(-180.0, 180.0),
        ],
    };
    let centre_m = match r.even(0.0, 1.0) {
        u if sane || u < 0.6 => DVec3::ZERO,
        u if u < 0.85 => r.direction() * half_m * r.logarithmic(0.1, 10.0),
        // Around the antennas.
        u if u < 0.95 => track.middle_m + r.direction() * half_m * r.even(0.0, 1.0),
        _ => track.middle_m + track.along * (track.length_m * r.even(-0.7, 0.7)),
    };
    let mut plane = Plane {
        centre_m,
        turn_deg,
        steps,
        counts,
        polar_from_m: None,
    };
    if !sane && r.chance(0.08) {
        let span_rad = r.logarithmic(0.02, TAU);
        plane.steps[1] = span_rad / counts[1] as f64;
        let depth_m = steps[0] * counts[0] as f64;
        plane.polar_from_m = Some(depth_m * r.even(0.0, 3.0));
    }
    plane
}

pub(super) fn window(r: &mut Random) -> Window {
    match r.even(0.0, 1.0) {
        u if u < 0.35 => Window::None,
        u if u < 0.7 => Window::default(),
        u if u < 0.85 => Window::Hamming,
        _ => Window::Kaiser {
            beta: r.even(0.0, 12.0),
        },
    }
}

/// Scatterers on and off the grid: of similar amplitude, or one bright and many weak.
fn scatter(r: &mut Random, case: &mut Case, half_m: f64) {
    let on = match r.chance(0.9) || case.sane {
        true => r.count(1, 12),
        false => 0,
    };
    let weak_db = match r.chance(0.3) {
        true => r.even(-60.0, 0.0),
        false => 0.0,
    };
    let plane = case.plane;
    let mut add = |r: &mut Random, at_m, level_db: f64| {
        let phase = r.even(-PI, PI);
        case.points.push(Point {
            at_m,
            amplitude: Complex64::from_polar(10f64.powf(level_db / 20.0), phase),
        });
    };
    for i in 0..on {
        let pick = DVec2::new(r.even(0.0, 1.0), r.even(0.0, 1.0));
        let row = (pick.x * plane.counts[0] as f64) as usize;
        let column = (pick.y * plane.counts[1] as f64) as usize;
        // At a pixel, or near one.
        let offset = DVec3::new(r.normal(), r.normal(), 0.1 * r.normal());
        let step_m = plane.steps[0] * if r.chance(0.3) { 0.0 } else { 0.5 };
        let at_m = plane.place_m(row, column) + offset * step_m;
        add(r, at_m, if i == 0 { 0.0 } else { weak_db });
    }
    if on == 0 || (!case.sane && r.chance(0.3)) {
        for _ in 0..r.count(1, 5) {
            let at_m = plane.centre_m + r.direction() * half_m * r.logarithmic(1.0, 30.0);
            let level_db = r.even(-20.0, 20.0);
            add(r, at_m, level_db);
        }
    }
}
