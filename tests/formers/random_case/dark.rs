//! Random cases whose grid contains little of the recording's energy: bright scatterers just outside the grid, in its side lobes, at
//! ambiguous distances, or far away; grids of a resolution cell or less; grids away from the scene's centre. Each case takes some
//! milliseconds for all formers.

use std::f64::consts::PI;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::signal::window::Window;

use super::draw::{Random, window};
use super::{Antennas, Case, LIGHT_M_S, Plane, Point, Shape, Track};

/// The case of a seed.
pub(crate) fn draw_dark(seed: u64) -> Case {
    let mut random = Random::new(seed ^ 0x6461_726b_0000_0000);
    let r = &mut random;
    let centre_hz = r.logarithmic(0.3e9, 80e9);
    let wavelength_m = LIGHT_M_S / centre_hz;
    let fraction = r.logarithmic(0.005, 0.4);
    let num_samples = r.count(6, 48);
    let num_pulses = r.count(8, 96);
    // Some images are compared at every pixel, most at a sample.
    let most = r.logarithmic(60.0, 1600.0);
    let stretch = r.logarithmic(0.1, 10.0);
    let counts = [most / stretch, most * stretch].map(|square| (square.sqrt() as usize).max(1));
    let step_hz = centre_hz * fraction / num_samples as f64;
    let resolution_m = LIGHT_M_S / (2.0 * centre_hz * fraction);
    // Pixels of tiny grids are much finer than the resolution.
    let finer = match r.chance(0.25) {
        true => r.logarithmic(0.003, 0.2),
        false => r.logarithmic(0.2, 1.5),
    };
    let row_step_m = resolution_m.min(3.0 * wavelength_m * num_pulses as f64) * finer;
    let column_step_m = row_step_m * r.logarithmic(0.3, 3.0);
    let half_m = (row_step_m * counts[0] as f64).hypot(column_step_m * counts[1] as f64) / 2.0;
    let range_m = (half_m * r.logarithmic(4.0, 3000.0)).max(10.0 * wavelength_m);
    let mut towards = r.direction();
    towards.z = r.even(0.05, 0.8);
    let towards = towards.normalize();
    let across = towards.any_orthonormal_vector();
    let turn = r.even(0.0, 2.0 * PI);
    let along = match r.chance(0.7) {
        true => (DVec3::Z.cross(towards).normalize() + towards * r.even(-0.3, 0.3)).normalize(),
        false => across * turn.cos() + towards.cross(across) * turn.sin(),
    };
    let angle = match r.chance(0.7) {
        true => (wavelength_m / (2.0 * resolution_m)).clamp(1e-4, 1.0) * r.logarithmic(0.3, 3.0),
        false => r.logarithmic(1e-3, 1.0),
    };
    let length_m = range_m * angle;
    let shape = match r.even(0.0, 10.0) as u32 {
        0..=5 => Shape::Straight,
        6 => Shape::Curved(r.logarithmic(1e-4, 0.1)),
        7 => Shape::Circle(angle.to_degrees().max(0.1)),
        8 => Shape::Sway(r.logarithmic(0.3, 10.0)),
        _ => Shape::Jitter,
    };
    let track = Track {
        shape,
        middle_m: towards * range_m,
        along,
        length_m,
        amplitude_m: wavelength_m * r.logarithmic(0.001, 3.0),
        antennas: match r.chance(0.85) {
            true => Antennas::Monostatic,
            false => Antennas::Apart(r.direction() * range_m * r.logarithmic(1e-4, 0.3)),
        },
        reference_m: if r.chance(0.8) {
            0.0
        } else {
            r.normal() * half_m
        },
        seed: r.bits(),
    };
    let centre_m = match r.chance(0.5) {
        true => DVec3::ZERO,
        // A grid away from the scene, in its plane.
        false => {
            let azimuth_rad = r.even(0.0, 2.0 * PI);
            let away_m = half_m * r.logarithmic(0.5, 30.0);
            DVec3::new(azimuth_rad.cos(), azimuth_rad.sin(), 0.0) * away_m.min(0.3 * range_m)
        }
    };
    let turn_deg = match r.chance(0.6) {
        // Rows along range.
        true => [towards.y.atan2(towards.x).to_degrees() + 90.0, 0.0, 0.0],
        false => [
            r.even(-180.0, 180.0),
            r.even(-40.0, 40.0),
            r.even(-40.0, 40.0),
        ],
    };
    let plane = Plane {
        centre_m,
        turn_deg,
        steps: [row_step_m, column_step_m],
        counts,
        polar_from_m: None,
    };
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
        bound_db: r.even(-100.0, -30.0).round(),
        sane: false,
    };
    if r.chance(0.1) {
        case.windows = [Window::None; 2];
    }
    bright_and_weak(r, &mut case, range_m);
    if r.chance(0.3) {
        case.noise = r.logarithmic(1e-6, 1e-1);
    }
    case
}

/// Add bright scatterers outside the grid, and weak ones (or no others) in it.
fn bright_and_weak(r: &mut Random, case: &mut Case, range_m: f64) {
    let plane = case.plane;
    let spans = [0, 1].map(|i| plane.steps[i] * plane.counts[i] as f64);
    let mut add = |r: &mut Random, rows: f64, columns: f64, level_db: f64| {
        // Offset from the grid's middle as a fraction of its sides.
        let middle = plane
            .place_m(0, 0)
            .midpoint(plane.place_m(plane.counts[0] - 1, plane.counts[1] - 1));
        let up = direction(&plane, spans[0], [1, 0]);
        let right = direction(&plane, spans[1], [0, 1]);
        let offset = up * (rows * spans[0]) + right * (columns * spans[1]);
        let offset = offset.clamp_length_max(0.5 * range_m);
        let phase = r.even(-PI, PI);
        case.points.push(Point {
            at_m: middle + offset,
            amplitude: Complex64::from_polar(10f64.powf(level_db / 20.0), phase),
        });
    };
    let side = |r: &mut Random| if r.chance(0.5) { 1.0 } else { -1.0 };
    for i in 0..r.count(1, 3) {
        // Near an edge, beyond a corner, or anywhere within some grid widths.
        let far = 0.5 + r.logarithmic(0.003, 30.0);
        let along = r.even(-0.5, 0.5);
        let [rows, columns] = match r.even(0.0, 4.0) as u32 {
            0 => [far * side(r), along],
            1 => [along, far * side(r)],
            2 => [far * side(r), (0.5 + r.logarithmic(0.003, 3.0)) * side(r)],
            _ => [r.normal() * far, r.normal() * far],
        };
        let level_db = if i == 0 { 0.0 } else { r.even(-30.0, 0.0) };
        add(r, rows, columns, level_db);
    }
    if r.chance(0.7) {
        let level_db = r.even(-120.0, -10.0);
        for _ in 0..r.count(1, 4) {
            let (rows, columns) = (r.even(-0.5, 0.5), r.even(-0.5, 0.5));
            add(r, rows, columns, level_db);
        }
    }
}

/// Unit vector of the step between rows or columns.
fn direction(plane: &Plane, span_m: f64, [rows, columns]: [usize; 2]) -> DVec3 {
    let wide = Plane {
        counts: [2, 2],
        steps: [span_m, span_m],
        ..*plane
    };
    (wide.place_m(rows, columns) - wide.place_m(0, 0)).normalize()
}
