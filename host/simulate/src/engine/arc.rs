//! Intra-pulse motion over a block of samples: phases as parabolas.
//!
//! Over a block, with `kappa = -1 .. 1` along it, the tracks of the antennas are approximated by parabolas through
//! three positions; that of the transmitter over the transmission times of the received samples. The delay of a
//! scatterer is solved at `kappa = -1, 0, 1`, and `d(kappa) = d0 + d1 kappa + d2 kappa^2` interpolates it. With `f = fc
//! + fw kappa` and the residual chirp rate `g`, the phase in turns, `-f d + g d^2 / 2`, is
//!
//! ```text
//! c0 = -fc d0 + g d0^2 / 2
//! c1 = -fw d0 - fc d1 + g d0 d1
//! c2 = -fw d1 - fc d2 + g (d1^2 / 2 + d0 d2)
//! ```
//!
//! The neglected terms are bounded, and the sweep is divided into blocks short enough to keep them below
//! [`NEGLECTED_RAD`]:
//!
//! - `kappa^3` and `kappa^4`: `|fw d2| + |g d1 d2| + |g| d2^2 / 2`;
//! - deviation `e` of an antenna's track from its parabola, measured between the nodes: `f e / c`;
//! - deviation of the delay from its parabola, `f max|d'''| / (9 sqrt 3)`. Differentiating `R^2 = r r` two and three
//!   times, with speed `v` and acceleration `a` (per unit of `kappa`) at range `R`: `|R''| <= v^2 / R + a`, `|R'''| <=
//!   3 v a / R + 2 v^3 / (sqrt 3 R^2)`.
//!
//! `c1` is a frequency of the NUFFT: a delay rate shifts the beat frequency. `c2` is expanded in a series
//! ([`super::run`]), valid for `pi |c2| <= 1`, which also bounds the block length.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::DVec3;

use super::View;
use super::chunk::{Chunk, LANES, Lanes, Phases};
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Largest phase error of a block, radians; a third of -80 dB.
const NEGLECTED_RAD: f64 = 3e-5;
/// Largest `pi |c2|`, radians.
pub(super) const MAX_BEND_RAD: f64 = 1.0;
/// Smallest block, samples; if even this is too long, the plain sum is used.
const MIN_SAMPLES: usize = 16;
/// Values of `kappa` at which an antenna's track is compared with its parabola.
const CHECKS: [f64; 6] = [-0.85, -0.58, -0.25, 0.25, 0.58, 0.85];

/// Distances of the nearest and farthest scatterers from one antenna, metres, and their largest speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub(super) near_m: f64,
    pub(super) far_m: f64,
    pub(super) speed_m_s: f64,
}

/// Parabola in space, `start + step x + bend x^2` for `|x| <= 1`.
#[derive(Clone, Copy, Debug)]
struct Parabola {
    start_m: DVec3,
    step_m: DVec3,
    bend_m: DVec3,
    /// Largest measured distance between the parabola and the track, metres.
    error_m: f64,
}

impl Parabola {
    fn through(place: impl Fn(f64) -> DVec3) -> Self {
        let [before, start_m, after] = [-1.0, 0.0, 1.0].map(&place);
        let mut parabola = Self {
            start_m,
            step_m: (after - before) / 2.0,
            bend_m: (after + before) / 2.0 - start_m,
            error_m: 0.0,
        };
        for x in CHECKS {
            // `f64::max` would ignore NaN.
            let error_m = place(x).distance(parabola.at(x));
            if error_m.is_nan() || error_m > parabola.error_m {
                parabola.error_m = error_m;
            }
        }
        parabola
    }

    fn at(&self, x: f64) -> DVec3 {
        self.start_m + (self.step_m + self.bend_m * x) * x
    }
}

/// Block of samples with parabolic phases.
#[derive(Clone, Debug)]
pub(super) struct Arc {
    pub(super) first: usize,
    pub(super) count: usize,
    centre_hz: f64,
    half_hz: f64,
    half_samples: f64,
    /// Distance from the far end of the block to the middle of the sweep, in half lengths of the block.
    to_middle: f64,
    residual_hz_s: f64,
    reference_s: f64,
    centre_s: f64,
    half_s: f64,
    receiver: Parabola,
    transmitter: Parabola,
    /// Time at the middle of the transmitter's parabola, and half its duration.
    sent_s: f64,
    sent_half_s: f64,
}

impl Arc {
    /// Smallest number of equal blocks with bounded errors, for scatterers at the given distances from transmitter and
    /// receiver; `None` if even the shortest blocks exceed the bound.
    pub(super) fn split(view: &View, transmitter: Reach, receiver: Reach) -> Option<Vec<Arc>> {
        let samples = view.sweep.count;
        let mut count = samples;
        loop {
            let arcs: Vec<Arc> = (0..samples)
                .step_by(count.max(1))
                .map(|first| {
                    let count = count.min(samples - first);
                    Arc::new(view, first, count, transmitter, receiver)
                })
                .collect();
            if arcs.iter().all(|arc| arc.is_good(transmitter, receiver)) {
                return Some(arcs);
            }
            count = count.div_ceil(2);
            if count < MIN_SAMPLES {
                return None;
            }
        }
    }

    fn new(view: &View, first: usize, count: usize, transmitter: Reach, receiver: Reach) -> Self {
        let sweep = &view.sweep;
        let half_samples = (count / 2).max(1) as f64;
        let centre = (first + count / 2) as f64;
        let centre_s = view.sample_s(centre);
        let half_s = half_samples * sweep.step_s;
        let late_s = (transmitter.far_m + receiver.far_m) / SPEED_OF_LIGHT_M_S;
        let soon_s = (transmitter.near_m + receiver.near_m) / SPEED_OF_LIGHT_M_S;
        let sent_s = centre_s - (late_s + soon_s) / 2.0;
        // 10 % longer, since the nearest scatterer may come closer before the block.
        let sent_half_s = 1.1 * (half_s.abs() + (late_s - soon_s) / 2.0) + 1e-12;
        Self {
            first,
            count,
            centre_hz: sweep.start_hz + sweep.step_hz * centre,
            half_hz: sweep.step_hz * half_samples,
            half_samples,
            to_middle: (centre - sweep.count as f64 / 2.0).abs() / half_samples + 1.0,
            residual_hz_s: sweep.residual_hz_s,
            reference_s: view.reference_s,
            centre_s,
            half_s,
            receiver: Parabola::through(|x| view.receiver_m(centre_s + x * half_s)),
            transmitter: Parabola::through(|x| view.transmitter_m(sent_s + x * sent_half_s)),
            sent_s,
            sent_half_s,
        }
    }

    fn is_good(&self, transmitter: Reach, receiver: Reach) -> bool {
        let c = SPEED_OF_LIGHT_M_S;
        let scale = self.half_s.abs() / self.sent_half_s;
        let (mut first, mut second, mut third, mut off) = (0.0, 0.0, 0.0, 0.0);
        for (track, reach, scale) in [
            (&self.receiver, receiver, 1.0),
            (&self.transmitter, transmitter, scale),
        ] {
            let v = (track.step_m.length() + 2.0 * track.bend_m.length()) * scale
                + reach.speed_m_s * self.half_s.abs();
            let a = 2.0 * track.bend_m.length() * scale * scale;
            // The distances are those at the middle of the sweep.
            let near_m = (reach.near_m - v * self.to_middle).max(0.0);
            first += v / c;
            second += (v * v / near_m + a) / c;
            third += (3.0 * v * a / near_m + 2.0 / 3f64.sqrt() * v.powi(3) / near_m.powi(2)) / c;
            off += track.error_m / c;
        }
        if first == 0.0 && second.is_nan() {
            // Nothing moves, and a scatterer is at an antenna's position.
            (second, third) = (0.0, 0.0);
        }
        let highest_hz = self.centre_hz.abs() + self.half_hz.abs();
        let g = self.residual_hz_s.abs();
        let path_m = transmitter.far_m + receiver.far_m;
        let far_s = path_m / c + self.reference_s.abs();
        let (d1, d2) = (first, second / 2.0);
        let cubic = self.half_hz.abs() * d2 + g * (d1 * d2 + d2 * d2 / 2.0);
        let neglected = cubic + highest_hz * (off + third / (9.0 * 3f64.sqrt()));
        let bend = self.half_hz.abs() * d1 + highest_hz * d2 + g * (d1 * d1 / 2.0 + far_s * d2);
        2.0 * PI * neglected <= NEGLECTED_RAD && PI * bend <= MAX_BEND_RAD
    }

    /// Phase coefficients of a scatterer from its delays, minus the reference delay, at `kappa = -1, 0, 1`; `c1` is per
    /// sample.
    #[inline(always)]
    fn coefficients(&self, before: f64, d0: f64, after: f64) -> [f64; 3] {
        let g = self.residual_hz_s;
        let d1 = (after - before) / 2.0;
        let d2 = (after + before) / 2.0 - d0;
        let c0 = (g * d0 / 2.0 - self.centre_hz) * d0;
        let c1 = (g * d0 - self.centre_hz) * d1 - self.half_hz * d0;
        let c2 = (g * d0 - self.centre_hz) * d2 + (g * d1 / 2.0 - self.half_hz) * d1;
        [c0, c1 / self.half_samples, c2]
    }

    /// Phases of static scatterers, or of those with constant velocities.
    pub(super) fn phases(&self, chunk: &Chunk, phases: &mut Phases) {
        let mut delays = [[0.0; LANES]; 3];
        for (kappa, delays) in [-1.0, 0.0, 1.0].into_iter().zip(&mut delays) {
            self.delays_s(&self.reflecting(chunk, kappa), kappa, delays);
        }
        let [before, middle, after] = &delays;
        for i in 0..LANES {
            [phases.turns[i], phases.slope[i], phases.bend[i]] =
                self.coefficients(before[i], middle[i], after[i]);
        }
    }

    /// Chunk with positions at the times of reflection of the wave received at `kappa`. One iteration of the fixed
    /// point: with a speed `u` the error is `u^2 / c` times the duration of the receive path.
    fn reflecting<'c>(&self, chunk: &'c Chunk, kappa: f64) -> Cow<'c, Chunk> {
        if !chunk.moves() {
            return Cow::Borrowed(chunk);
        }
        let received_s = self.centre_s + kappa * self.half_s;
        let mut ranges_m = [0.0; LANES];
        chunk
            .at(|_| received_s)
            .ranges_m(self.receiver.at(kappa), &mut ranges_m);
        chunk.at(|i| received_s - ranges_m[i] / SPEED_OF_LIGHT_M_S)
    }

    /// Delays minus the reference delay at `kappa`. Two iterations of the fixed point. The initial guess, twice the
    /// receive path, is wrong by the distance between the antennas and the transmitter's motion, at most some `1e-7` s.
    /// Each iteration reduces the error by `v / c`: below 1e-16 s for a satellite, 1e-20 s for an aircraft.
    fn delays_s(&self, chunk: &Chunk, kappa: f64, out: &mut Lanes<f64>) {
        let c = SPEED_OF_LIGHT_M_S;
        let receiver_m = self.receiver.at(kappa);
        let received_s = self.centre_s + kappa * self.half_s - self.sent_s;
        let Parabola {
            start_m,
            step_m,
            bend_m,
            ..
        } = self.transmitter;
        let per_half = 1.0 / self.sent_half_s;
        for i in 0..LANES {
            let (px, py, pz) = (chunk.x_m[i], chunk.y_m[i], chunk.z_m[i]);
            let (x, y, z) = (px - receiver_m.x, py - receiver_m.y, pz - receiver_m.z);
            let back_s = (x * x + y * y + z * z).sqrt() / c;
            let mut delay_s = 2.0 * back_s;
            for _ in 0..2 {
                let t = (received_s - delay_s) * per_half;
                let x = px - (start_m.x + (step_m.x + bend_m.x * t) * t);
                let y = py - (start_m.y + (step_m.y + bend_m.y * t) * t);
                let z = pz - (start_m.z + (step_m.z + bend_m.z * t) * t);
                delay_s = back_s + (x * x + y * y + z * z).sqrt() / c;
            }
            out[i] = delay_s - self.reference_s;
        }
    }

    /// Phase of one scatterer at `place(t)`, solved without the antennas' parabolas; `None` if it deviates from a
    /// parabola, measured at `kappa = +-1/2`.
    pub(super) fn phase(&self, view: &View, place: impl Fn(f64) -> DVec3) -> Option<[f64; 3]> {
        let [before, early, middle, late, after] = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|kappa| {
            let time_s = self.centre_s + kappa * self.half_s;
            let receiver_m = view.receiver_m(time_s);
            view.delay_s(&place, time_s, receiver_m, 0.0) - self.reference_s
        });
        let found = self.coefficients(before, middle, after);
        let [c0, c1, c2] = found;
        let good = [(-0.5, early), (0.5, late)].into_iter().all(|(kappa, d)| {
            let true_turns =
                (self.residual_hz_s * d / 2.0 - self.centre_hz - self.half_hz * kappa) * d;
            let turns = c0 + c1 * self.half_samples * kappa + c2 * kappa * kappa;
            2.0 * PI * (true_turns - turns).abs() <= NEGLECTED_RAD
        });
        (good && PI * c2.abs() <= MAX_BEND_RAD).then_some(found)
    }
}
