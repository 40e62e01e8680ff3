//! Grating lobes of range-Doppler backprojection in the thesis's mode, from geometry alone.
//!
//! Sub-CPI `s` of `M` pulses takes the path to a point as a straight line in slow time, `a_s(p) +
//! b_s(p) u`, `u_m = m - (M - 1) / 2` (Schone 2020, (2.18)). With `e_m` metres what that line leaves of
//! the path to a scatterer at `q`, the image of it is an array of sub-CPIs (S 4.1.2), each with a
//! pattern of its own:
//!
//! ```text
//! I(p) = 1/N sum_s  A(a_s(p) - a_s(q))  E_s(b_s(p) - b_s(q))
//! A(a) = exp(+j 2 pi f_c a / c) 1/K sum_k exp(+j 2 pi (k - K/2) step a / c)     range response, at its place
//! E(b) = sum_m exp(+j 2 pi f_c (b u_m - e_m) / c)                               element pattern
//! ```
//!
//! On a straight track, pulses `d` apart, the array factor `sum_s A` repeats where the path changes by a
//! wavelength from sub-CPI to sub-CPI, `D = M d` apart:
//!
//! ```text
//! x_k = k lambda R / (2 D)
//! ```
//!
//! the lobes of a physical array with elements `2 D` apart (Figure 4.5). There `b u f_c / c` is `k u / M`, so
//! `E` would be a sum over `k` whole turns: zero. A path that were the line had no grating lobes.
//! What fills the nulls is `e_m = d^2 u^2 / R`. To first order in the phase at the sub-CPI's edge,
//! `phi = 2 pi (D/2)^2 / (lambda R)`,
//!
//! ```text
//! |E(x_k) / E(0)| = 2 phi / (pi k)^2 = D^2 / (pi k^2 lambda R)
//! ```
//!
//! (-20.9 dB for 52 pulses on Table 4.1, 12 dB less for every doubling of `k` and 12 dB more for every
//! doubling of `M`). The sub-CPI's own range migration, seen from a point off the
//! scatterer, takes the rest: at `x_k` the ends of an aperture of length `L` see the scatterer `L x_k / R` of path
//! away from the point, and the mean over the aperture of the range response is
//!
//! ```text
//! Si(pi w) / (pi w),   w = B L x_k / (R c)
//! ```
//!
//! (-0.2, -0.8, -1.8 dB for the first three). [`lobe_level`] is the product, [`PointResponse`] the sum itself
//! on a recorded track.
//!
//! A recording whose phases are compensated to a point, pulse by pulse, has only the differential `e_m` left
//! and lobes as much lower.
//!
//! Neglected: Keystone's truncated edges (-50 dB or so), the dependence of `e_m`'s phase on frequency (half the
//! relative bandwidth), zero padding and bilinear reading (-60 dB).
//!
//! Accuracy: `tests/planning/radar.rs` forms the image. With 20 sub-CPIs of Table 4.1 the first three lobes (-21.1, -33.6 and
//! -41.7 dB) lie within 0.1 m and 0.4 dB of both predictions; with 10 and 8 sub-CPIs (-8.4 and -3.7 dB, the thesis's
//! "slightly less than 4 dB") within 0.1 dB of the sum. Below -48 dB what is neglected shows.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use num_complex::Complex64;
use serde::Serialize;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, Collection, Pulse};

/// A predicted grating lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lobe {
    /// 1 for the first on either side.
    pub order: usize,
    /// Distance from the scatterer in cross-range, metres.
    pub cross_range_m: f64,
    /// Level relative to the main lobe, dB.
    pub level_db: f64,
}

/// The geometry of a broadside pass along a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// Wavelength at the reference frequency, metres.
    pub wavelength_m: f64,
    /// Bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Slant range at closest approach, metres.
    pub range_m: f64,
    /// Distance from pulse to pulse, metres.
    pub spacing_m: f64,
    /// Pulses in all.
    pub num_pulses: usize,
}

/// Grating lobe `order` for sub-CPIs of `sub_cpi` pulses by the closed form at the head of this module: for
/// phases at the sub-CPI's edge below a radian or so.
pub fn lobe_level(pass: &Pass, sub_cpi: usize, order: usize) -> Lobe {
    let length_m = sub_cpi as f64 * pass.spacing_m;
    let k = order as f64;
    let cross_range_m = k * pass.wavelength_m * pass.range_m / (2.0 * length_m);
    let element = length_m.powi(2) / (PI * k * k * pass.wavelength_m * pass.range_m);
    let aperture_m = pass.num_pulses as f64 * pass.spacing_m;
    let walk = pass.bandwidth_hz * aperture_m * cross_range_m / (pass.range_m * SPEED_OF_LIGHT_M_S);
    Lobe {
        order,
        cross_range_m,
        level_db: 20.0 * (element * mean_sinc(walk).abs()).log10(),
    }
}

/// Mean of `sin(pi w t) / (pi w t)` for `t` from 0 to 1, which is `Si(pi w) / (pi w)`: by the midpoint rule,
/// eight points a half wave, which is good to 1e-3.
fn mean_sinc(w: f64) -> f64 {
    let points = 8 * (w.abs().ceil() as usize).clamp(1, 100_000);
    let sinc = |i| {
        let angle = PI * w * (f64::from(i) + 0.5) / points as f64;
        if angle == 0.0 {
            1.0
        } else {
            angle.sin() / angle
        }
    };
    (0..points as u32).map(sinc).sum::<f64>() / points as f64
}

/// What the thesis's mode makes of one unit scatterer, on a collection's own track.
#[derive(Clone, Debug)]
pub struct PointResponse {
    band: Band,
    num_pulses: usize,
    sub_cpis: Vec<Element>,
}

/// One sub-CPI.
#[derive(Clone, Debug)]
struct Element {
    antennas: [Moving; 2],
    /// Path and rate to the scatterer.
    path_m: f64,
    rate_m: f64,
    /// Slow time and the path's remainder, pulse by pulse.
    remainders: Vec<(f64, f64)>,
}

/// An antenna at the sub-CPI's centre.
#[derive(Clone, Copy, Debug)]
struct Moving {
    position_m: DVec3,
    /// Metres a pulse.
    velocity_m: DVec3,
}

impl PointResponse {
    /// For a scatterer at `scatterer`, sub-CPIs of `sub_cpi` pulses, the last one shorter if need be. `None`
    /// if the pulses do not share one band, or there are none, or `sub_cpi` is zero.
    pub fn new(collection: &Collection, sub_cpi: usize, scatterer: DVec3) -> Option<Self> {
        let band = collection.band()?;
        if sub_cpi == 0 {
            return None;
        }
        let elements = collection.pulses.chunks(sub_cpi);
        Some(Self {
            band,
            num_pulses: collection.pulses.len(),
            sub_cpis: elements
                .map(|pulses| Element::new(pulses, scatterer))
                .collect(),
        })
    }

    /// The image's value at `point`.
    pub fn at(&self, point: DVec3) -> Complex64 {
        let sum: Complex64 = self.sub_cpis.iter().map(|s| s.at(&self.band, point)).sum();
        sum / self.num_pulses as f64
    }
}

impl Element {
    fn new(pulses: &[Pulse], scatterer: DVec3) -> Self {
        let antennas = [
            Moving::middle(pulses, |p| p.transmitter_m),
            Moving::middle(pulses, |p| p.receiver_m),
        ];
        let (path_m, rate_m) = path_and_rate(&antennas, scatterer);
        // The reference path is known pulse by pulse, and cancels between point and scatterer: what counts is how
        // far from a line the path is that the samples have.
        let reference = Moving::middle(pulses, |p| DVec3::X * p.reference_path_m);
        let remainders = (0..).zip(pulses).map(|(m, pulse)| {
            let u = f64::from(m) - (pulses.len() as f64 - 1.0) / 2.0;
            let line_m = path_m - reference.position_m.x + (rate_m - reference.velocity_m.x) * u;
            (u, pulse.relative_path_m(scatterer) - line_m)
        });
        Self {
            antennas,
            path_m,
            rate_m,
            remainders: remainders.collect(),
        }
    }

    fn at(&self, band: &Band, point: DVec3) -> Complex64 {
        let (path_m, rate_m) = path_and_rate(&self.antennas, point);
        let cycles_m = band.centre_hz() / SPEED_OF_LIGHT_M_S;
        let path_m = path_m - self.path_m;
        let rate_m = rate_m - self.rate_m;
        let pattern: Complex64 = self
            .remainders
            .iter()
            .map(|(u, remainder_m)| Complex64::cis(TAU * cycles_m * (rate_m * u - remainder_m)))
            .sum();
        let step = path_m * band.step_hz / SPEED_OF_LIGHT_M_S;
        pattern * Complex64::cis(TAU * cycles_m * path_m) * range_response(step, band.count)
    }
}

impl Moving {
    /// Position and slope at `u = 0` of the least-squares parabola through the pulses' positions.
    fn middle(pulses: &[Pulse], position: impl Fn(&Pulse) -> DVec3) -> Self {
        let count = pulses.len() as f64;
        let slow_times = || (0..).map(|m| f64::from(m) - (count - 1.0) / 2.0);
        let mean_square = (count * count - 1.0) / 12.0;
        // Relative to one position, so that the sums keep their digits far from the origin.
        let origin = position(&pulses[0]);
        // A polynomial's coefficient; none where it vanishes on so few pulses.
        let fit = |polynomial: &dyn Fn(f64) -> f64| {
            let (mut sum, mut norm) = (DVec3::ZERO, 0.0);
            for (u, pulse) in slow_times().zip(pulses) {
                let value = polynomial(u);
                sum += (position(pulse) - origin) * value;
                norm += value * value;
            }
            if norm > 1e-9 { sum / norm } else { DVec3::ZERO }
        };
        let bend = fit(&|u| u * u - mean_square);
        Self {
            position_m: origin + fit(&|_| 1.0) - bend * mean_square,
            velocity_m: fit(&|u| u),
        }
    }
}

/// Path from the first antenna by way of `point` to the second, and its rate a pulse.
fn path_and_rate(antennas: &[Moving; 2], point: DVec3) -> (f64, f64) {
    let leg = |antenna: &Moving| {
        let sight = antenna.position_m - point;
        let range_m = sight.length();
        // At the antenna itself there is no direction.
        let direction = sight.normalize_or_zero();
        (range_m, direction.dot(antenna.velocity_m))
    };
    let (out, back) = (leg(&antennas[0]), leg(&antennas[1]));
    (out.0 + back.0, out.1 + back.1)
}

/// `1/K sum_k exp(j 2 pi (k - K/2) x)`, by the geometric series.
fn range_response(x: f64, count: usize) -> Complex64 {
    let k = count as f64;
    let ratio = (PI * x).sin();
    let magnitude = if ratio.abs() < 1e-12 {
        1.0
    } else {
        (PI * k * x).sin() / (k * ratio)
    };
    // The sum runs from -K/2 to K/2 - 1 for even K: half a step below its middle.
    let middle = (k - 1.0) / 2.0 - (count / 2) as f64;
    Complex64::cis(TAU * middle * x) * magnitude
}

/// The lobes of a scatterer at `scatterer` up to `reach_m` away in cross-range, at most `count`, on the track as
/// recorded: places by the array formula, levels by [`PointResponse`] there, at the scatterer's range. Empty
/// if the antennas stand still or the pulses share no band.
pub fn lobes(
    collection: &Collection,
    sub_cpi: usize,
    scatterer: DVec3,
    reach_m: f64,
    count: usize,
) -> Vec<Lobe> {
    let Some(response) = PointResponse::new(collection, sub_cpi, scatterer) else {
        return Vec::new();
    };
    let Some(array) = Array::new(collection, sub_cpi, scatterer) else {
        return Vec::new();
    };
    let main = response.at(scatterer).norm();
    (1..=count)
        .map(|order| (order, order as f64 * array.lobe_m))
        .take_while(|&(_, cross_range_m)| cross_range_m <= reach_m)
        .map(|(order, cross_range_m)| {
            let level = response.at(array.point(scatterer, cross_range_m)).norm() / main;
            Lobe {
                order,
                cross_range_m,
                level_db: 20.0 * level.log10(),
            }
        })
        .collect()
}

/// The array of sub-CPIs seen from a scatterer.
struct Array {
    /// Middle of the aperture.
    antenna_m: DVec3,
    /// Place of the first lobe, metres in cross-range.
    lobe_m: f64,
}

impl Array {
    fn new(collection: &Collection, sub_cpi: usize, scatterer: DVec3) -> Option<Self> {
        let pulses = &collection.pulses;
        let centre = |pulse: &Pulse| pulse.transmitter_m.midpoint(pulse.receiver_m);
        let antenna_m = centre(&pulses[pulses.len() / 2]);
        let last = pulses.len() - 1;
        let step_m = (centre(&pulses[last]) - centre(&pulses[0])) / last.max(1) as f64;
        let sight = scatterer - antenna_m;
        let range_m = sight.length();
        // Across the line of sight, in the ground plane: the only way in which the path's rate changes at
        // one range.
        let across = DVec2::new(-sight.y, sight.x).normalize_or_zero();
        let spacing_m = step_m.truncate().dot(across).abs() * sub_cpi as f64;
        let wavelength_m = SPEED_OF_LIGHT_M_S / collection.band()?.centre_hz();
        let lobe_m = wavelength_m * range_m / (2.0 * spacing_m);
        (lobe_m.is_finite()).then_some(Self { antenna_m, lobe_m })
    }

    /// The point `cross_range_m` from `scatterer` at its range: turned about the antenna's vertical.
    fn point(&self, scatterer: DVec3, cross_range_m: f64) -> DVec3 {
        let sight = scatterer - self.antenna_m;
        let ground = sight.truncate();
        let turned = DVec2::from_angle(cross_range_m / ground.length()).rotate(ground);
        self.antenna_m + turned.extend(sight.z)
    }
}
