//! Expected values of the item on the truck-borne radar of Chim 2018, by a plain sum over pulses.
//!
//! A reflector's image on a track is the sum over pulses of the band's response (sinc) at the difference of the two-way paths, on that track
//! and on the true one, with the phase of this difference at the middle frequency, weighted by the two-way Gaussian beam.

use std::f64::consts::{LN_2, PI, TAU};

use num_complex::Complex64;
use subaperture::glam::{DVec2, DVec3};
use subaperture::simulate::Experiment;
use subaperture::simulate::scenario::{Scenario, examples};

use crate::figures::{About, Figure, at_most, figure};
use crate::sub_cpis::{LIGHT_M_S, decibels, sinc};

const CENTRE_HZ: f64 = 1.85e9;
const BANDWIDTH_HZ: f64 = 300e6;
const BEAM_RAD: f64 = 13.3 * PI / 180.0;
/// Standard deviation of the log's positions, metres.
const NOISE_M: f64 = 4e-3;
/// Spacing of pixels and half of the searched area, as in the item.
const PIXEL_M: f64 = 0.1;
const REACH: i32 = 15;

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    (id == "c-4-4").then(truck)
}

/// True positions of the body, those at constant velocity, and those moved to the line, at times in seconds.
struct Tracks {
    truck: Experiment,
    middle_s: f64,
    middle_m: DVec3,
    velocity_m_s: DVec3,
}

impl Tracks {
    fn new() -> Self {
        let text = examples::text("truck").unwrap();
        let truck = Scenario::new("truck.toml", text, ".").experiment().unwrap();
        // The times of the log, from 1 s before the first pulse to 1 s after the last.
        let last_s = 0.1 * (truck.radar.num_pulses as f64 - 1.0);
        let count = ((last_s + 2.0) * 20.0).round() as usize + 1;
        let times_s: Vec<f64> = (0..count).map(|n| n as f64 / 20.0 - 1.0).collect();
        let number = count as f64;
        let at = |time_s: f64| truck.track.pose(time_s).position_m;
        let middle_s = times_s.iter().sum::<f64>() / number;
        let middle_m = times_s.iter().map(|&t| at(t)).sum::<DVec3>() / number;
        let moments = times_s.iter().map(|&t| at(t) * (t - middle_s));
        let spread: f64 = times_s.iter().map(|t| (t - middle_s).powi(2)).sum();
        let velocity_m_s = moments.sum::<DVec3>() / spread;
        Self {
            truck,
            middle_s,
            middle_m,
            velocity_m_s,
        }
    }

    fn steady_m(&self, time_s: f64) -> DVec3 {
        self.middle_m + self.velocity_m_s * (time_s - self.middle_s)
    }

    fn on_line_m(&self, time_s: f64) -> DVec3 {
        let along = self.velocity_m_s.normalize();
        let from_m = self.truck.track.pose(time_s).position_m - self.middle_m;
        self.middle_m + along * along.dot(from_m)
    }

    /// RMS deviation from constant velocity along an axis at the times of the pulses, metres.
    fn deviation_m(&self, axis: DVec3) -> f64 {
        let times = self.times_s();
        let square = |time_s: &f64| {
            let off_m = self.truck.track.pose(*time_s).position_m - self.steady_m(*time_s);
            axis.dot(off_m).powi(2)
        };
        (times.iter().map(square).sum::<f64>() / times.len() as f64).sqrt()
    }

    fn times_s(&self) -> Vec<f64> {
        let pulses = self.truck.radar.num_pulses;
        (0..pulses).map(|n| 0.1 * n as f64).collect()
    }

    /// Largest magnitude of a reflector's image near its place, formed on a track from the pulses whose half-power beam covers the place.
    fn level(&self, place_m: DVec3, track_m: &dyn Fn(f64) -> DVec3) -> f64 {
        let path_m = |body_m: DVec3, place_m: DVec3| {
            let antennas = [-0.2, 0.2].map(|x_m| body_m + DVec3::X * x_m);
            antennas.iter().map(|a| a.distance(place_m)).sum::<f64>()
        };
        let off = |body_m: DVec3| (place_m - body_m).truncate().angle_to(DVec2::Y) / BEAM_RAD;
        let covered = |time_s: &f64| off(track_m(*time_s)).abs() <= 0.5;
        let pulses: Vec<(DVec3, f64, f64)> = self
            .times_s()
            .into_iter()
            .filter(covered)
            .map(|time_s| {
                let body_m = self.truck.track.pose(time_s).position_m;
                let weight = (-4.0 * LN_2 * off(body_m).powi(2)).exp();
                (track_m(time_s), path_m(body_m, place_m), weight)
            })
            .collect();
        let pixels = (-REACH..=REACH).flat_map(|i| (-REACH..=REACH).map(move |j| (i, j)));
        let magnitudes = pixels.map(|(i, j)| {
            let step = DVec3::new(f64::from(i), f64::from(j), 0.0) * PIXEL_M;
            let terms = pulses.iter().map(|(body_m, true_m, weight)| {
                let off_m = path_m(*body_m, place_m + step) - true_m;
                let phase = TAU * CENTRE_HZ * off_m / LIGHT_M_S;
                Complex64::cis(phase) * (weight * sinc(BANDWIDTH_HZ * off_m / LIGHT_M_S))
            });
            terms.sum::<Complex64>().norm() / pulses.len() as f64
        });
        magnitudes.fold(0.0, f64::max)
    }

    /// Least level of a reflector on a track relative to the true one, dB.
    fn least_db(&self, track_m: &dyn Fn(f64) -> DVec3) -> f64 {
        let true_m = |time_s: f64| self.truck.track.pose(time_s).position_m;
        let levels = self.truck.scene.corners.iter().map(|corner| {
            let place_m = corner.position_m;
            decibels(self.level(place_m, track_m) / self.level(place_m, &true_m))
        });
        levels.fold(f64::INFINITY, f64::min)
    }
}

fn truck() -> Vec<Figure> {
    let tracks = Tracks::new();
    let [along_m, across_m] = [DVec3::X, DVec3::Y].map(|axis| tracks.deviation_m(axis));
    // Phases of independent errors: exp(-sigma^2) in power, the deviation of a mean over 20 pulses or more of the beam.
    let phase_rad = 2.0 * TAU * CENTRE_HZ / LIGHT_M_S * NOISE_M;
    let noise_db = decibels((-phase_rad * phase_rad / 2.0).exp());
    // The pulses of a block of the image are those of its centre: the aperture is shifted by up to a sixteenth. Shifted so, this sum varies by
    // 1 dB for a reflector; as much is for the side lobes of the others in the response of a blurred one.
    let others_db = 2.0;
    let shift_db = 0.4;
    vec![
        figure(
            "deviation from constant velocity, RMS along the track and across",
            "not perfectly uniform",
            "{} m, {} m",
            // The log has two more seconds, a thirtieth.
            [
                About(along_m, along_m / 30.0),
                About(across_m, across_m / 30.0),
            ],
            "the simulated track",
        ),
        figure(
            "weakest reflector at constant velocity, relative to the true track",
            "not given",
            "{} dB",
            [About(tracks.least_db(&|t| tracks.steady_m(t)), others_db)],
            "the sum over pulses",
        ),
        figure(
            "with along-track positions of the log",
            "variation in speed was compensated",
            "{} dB",
            [About(tracks.least_db(&|t| tracks.on_line_m(t)), others_db)],
            "the sum over pulses",
        ),
        figure(
            "with motion compensation in range too",
            "does not work for ground-based systems",
            "{} dB",
            [About(noise_db, shift_db)],
            "errors of the log of 4 mm",
        ),
        figure(
            "with backprojection on the log's track",
            "to consider instead of range-Doppler",
            "{} dB",
            [About(noise_db, shift_db)],
            "errors of the log of 4 mm",
        ),
        figure(
            "difference of the range-Doppler image from it",
            "not given",
            "{} dB",
            [at_most(-30.0)],
            "the bound of the range-Doppler algorithm",
        ),
        figure(
            "largest distance of a reflector from its place on the Earth",
            "overlay on Google Earth",
            "{} m",
            [at_most(PIXEL_M * 0.5f64.sqrt() + 0.05)],
            "half a pixel in both axes, and a tenth of the resolution",
        ),
    ]
}
