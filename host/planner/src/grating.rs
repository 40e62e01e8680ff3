//! Grating lobes of range-Doppler backprojection in the thesis's mode, predicted from geometry.
//!
//! Sub-CPI `s` of `M` pulses approximates the path to a point as linear in slow time, `a_s(p) +
//! b_s(p) u`, `u_m = m - (M - 1) / 2` (Schone 2020, (2.18)). With the residual `e_m`, metres, of that line from
//! the path to a scatterer at `q`, its image is an array of sub-CPIs (S 4.1.2), each with its
//! own element pattern:
//!
//! ```text
//! I(p) = 1/N sum_s  A(a_s(p) - a_s(q))  E_s(b_s(p) - b_s(q))
//! A(a) = exp(+j 2 pi f_c a / c) 1/K sum_k exp(+j 2 pi (k - K/2) step a / c)     range response
//! E(b) = sum_m exp(+j 2 pi f_c (b u_m - e_m) / c)                               element pattern
//! ```
//!
//! On a straight track with pulse spacing `d`, the array factor `sum_s A` repeats where the path changes by one
//! wavelength between sub-CPIs, `D = M d` apart:
//!
//! ```text
//! x_k = k lambda R / (2 D)
//! ```
//!
//! the grating lobes of a physical array with element spacing `2 D` (Figure 4.5). There `b u f_c / c` is `k u / M`, so
//! for a linear path `E` would be a sum over `k` whole turns: zero, no grating lobes.
//! The residual `e_m = d^2 u^2 / R` fills the nulls. To first order in the phase at the sub-CPI's edge,
//! `phi = 2 pi (D/2)^2 / (lambda R)`,
//!
//! ```text
//! |E(x_k) / E(0)| = 2 phi / (pi k)^2 = D^2 / (pi k^2 lambda R)
//! ```
//!
//! (-20.9 dB for 52 pulses on Table 4.1, 12 dB less for every doubling of `k` and 12 dB more for every
//! doubling of `M`). Range migration of the scatterer relative to the point reduces the lobe further: at `x_k`, over an
//! aperture of length `L`, the path difference changes by `L x_k / R`, and the mean of the range response over the aperture is
//!
//! ```text
//! Si(pi w) / (pi w),   w = B L x_k / (R c)
//! ```
//!
//! (-0.2, -0.8, -1.8 dB for the first three). [`lobe_level`] is the product; [`PointResponse`] evaluates the sum
//! on a recorded track.
//!
//! In a recording compensated to a point pulse by pulse, only the differential `e_m` remains,
//! and the lobes are lower accordingly.
//!
//! Neglected: truncated edges of the Keystone transform (about -50 dB), the dependence of `e_m`'s phase on frequency (half the
//! relative bandwidth), zero padding and bilinear interpolation (-60 dB).
//!
//! **Accuracy** `tests/planning/radar.rs` forms the image. With 20 sub-CPIs of Table 4.1 the first three lobes (-21.1, -33.6 and
//! -41.7 dB) are within 0.1 m and 0.4 dB of both predictions; with 10 and 8 sub-CPIs (-8.4 and -3.7 dB, the thesis's
//! "slightly less than 4 dB") within 0.1 dB of the sum. Below -48 dB the neglected terms dominate.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use num_complex::Complex64;
use serde::Serialize;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, Collection, Pulse};

/// Predicted grating lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lobe {
    /// Order; 1 is the first on either side.
    pub order: usize,
    /// Distance from the scatterer in cross-range, metres.
    pub cross_range_m: f64,
    /// Level relative to the main lobe, dB.
    pub level_db: f64,
}

/// Geometry of a straight broadside pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// Wavelength at the reference frequency, metres.
    pub wavelength_m: f64,
    /// Bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Slant range at closest approach, metres.
    pub range_m: f64,
    /// Pulse spacing, metres.
    pub spacing_m: f64,
    /// Number of pulses.
    pub num_pulses: usize,
}

/// Grating lobe `order` for sub-CPIs of `sub_cpi` pulses by the closed form at the head of this module; valid for
/// phases at the sub-CPI's edge below about one radian.
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

/// Mean of `sin(pi w t) / (pi w t)` over `t` from 0 to 1, which is `Si(pi w) / (pi w)`, by the midpoint rule with
/// eight points per half wave; error 1e-3.
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

/// Image of one unit scatterer in the thesis's mode, on a recorded track.
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
    /// Path and path rate to the scatterer, metres and metres per pulse.
    path_m: f64,
    rate_m: f64,
    /// Slow time and path residual per pulse.
    remainders: Vec<(f64, f64)>,
}

/// Antenna position and velocity at the sub-CPI's centre.
#[derive(Clone, Copy, Debug)]
struct Moving {
    position_m: DVec3,
    /// Velocity, metres per pulse.
    velocity_m: DVec3,
}

impl PointResponse {
    /// Response of a scatterer at `scatterer` with sub-CPIs of `sub_cpi` pulses; the last may be shorter. `None`
    /// if the pulses do not share one band, there are no pulses, or `sub_cpi` is zero.
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

    /// Image value at `point`.
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
        // The reference path is known per pulse and cancels between point and scatterer; the deviation of the samples' own
        // path from a line remains.
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
    /// Position and slope at `u = 0` of the least-squares parabola through the pulse positions.
    fn middle(pulses: &[Pulse], position: impl Fn(&Pulse) -> DVec3) -> Self {
        let count = pulses.len() as f64;
        let slow_times = || (0..).map(|m| f64::from(m) - (count - 1.0) / 2.0);
        let mean_square = (count * count - 1.0) / 12.0;
        // Relative to one position, to keep digits far from the origin.
        let origin = position(&pulses[0]);
        // Coefficient of an orthogonal polynomial; 0 where it vanishes on so few pulses.
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

/// Two-way path from the first antenna via `point` to the second, and its rate per pulse.
fn path_and_rate(antennas: &[Moving; 2], point: DVec3) -> (f64, f64) {
    let leg = |antenna: &Moving| {
        let sight = antenna.position_m - point;
        let range_m = sight.length();
        // The direction is undefined at the antenna itself.
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
    // For even K the sum runs from -K/2 to K/2 - 1: half a step below its centre.
    let middle = (k - 1.0) / 2.0 - (count / 2) as f64;
    Complex64::cis(TAU * middle * x) * magnitude
}

/// Grating lobes of a scatterer up to `reach_m` in cross-range, at most `count`, on the recorded
/// track: positions by the array formula, levels by [`PointResponse`] at the scatterer's range. Empty
/// if the antennas do not move or the pulses do not share a band.
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

/// Array of sub-CPIs seen from a scatterer.
struct Array {
    /// Antenna at the aperture's centre, metres.
    antenna_m: DVec3,
    /// Position of the first lobe in cross-range, metres.
    lobe_m: f64,
}

impl Array {
    fn new(collection: &Collection, sub_cpi: usize, scatterer: DVec3) -> Option<Self> {
        let pulses = &collection.pulses;
        let centre = |pulse: &Pulse| pulse.phase_centre_m();
        let antenna_m = centre(&pulses[pulses.len() / 2]);
        let last = pulses.len() - 1;
        let step_m = (centre(&pulses[last]) - centre(&pulses[0])) / last.max(1) as f64;
        let sight = scatterer - antenna_m;
        let range_m = sight.length();
        // Cross-range in the ground plane: the only direction in which the path rate changes at
        // constant range.
        let across = DVec2::new(-sight.y, sight.x).normalize_or_zero();
        let spacing_m = step_m.truncate().dot(across).abs() * sub_cpi as f64;
        let wavelength_m = SPEED_OF_LIGHT_M_S / collection.band()?.centre_hz();
        let lobe_m = wavelength_m * range_m / (2.0 * spacing_m);
        (lobe_m.is_finite()).then_some(Self { antenna_m, lobe_m })
    }

    /// Point at `cross_range_m` from `scatterer` at constant range: rotated about the antenna's vertical.
    fn point(&self, scatterer: DVec3, cross_range_m: f64) -> DVec3 {
        let sight = scatterer - self.antenna_m;
        let ground = sight.truncate();
        let turned = DVec2::from_angle(cross_range_m / ground.length()).rotate(ground);
        self.antenna_m + turned.extend(sight.z)
    }
}
