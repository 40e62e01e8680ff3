//! Target position from its range and direction of arrival (DOA).

use core::f64::consts::{PI, TAU};

use super::plane::{Vector, direction, dot, length, minus, plus, rotated, times};
use super::{Echo, Increment};

/// Number of standard deviations that a phase ambiguity must be resolved with.
const AMBIGUITY_SIGMAS: f64 = 3.0;
/// Phase deviation from the prediction, as a fraction of pi, above which the phase may have wrapped.
const WRAP_LIMIT: f64 = 0.6;

/// Target position and phases measured in one pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting<const CHANNELS: usize> {
    pub(super) target: u16,
    pub(super) position_m: Vector,
    /// Phases unwrapped between channels.
    pub(super) phases_rad: [f64; CHANNELS],
    pub(super) weight: f64,
    pub(super) doubtful: usize,
}

/// Sums for a straight-line fit to the channels' phase errors.
#[derive(Clone, Copy, Default)]
struct Line {
    count: f64,
    levers: f64,
    squares: f64,
    errors: f64,
    products: f64,
}

impl Line {
    fn add(&mut self, error: f64, lever: f64) {
        self.count += 1.0;
        self.levers += lever;
        self.squares += lever * lever;
        self.errors += error;
        self.products += error * lever;
    }

    fn spread(&self) -> f64 {
        self.squares - self.levers * self.levers / self.count
    }

    fn slope(&self) -> f64 {
        (self.products - self.errors * self.levers / self.count) / self.spread()
    }
}

/// Antenna array and derived quantities.
#[derive(Clone, Debug)]
pub(super) struct Array<const CHANNELS: usize> {
    /// Transmitter and receiver of each channel. The first `used` entries are valid.
    pub(super) channels: [[Vector; 2]; CHANNELS],
    pub(super) used: usize,
    pub(super) centre_m: Vector,
    /// Channels of the closest pair of receivers, and the vector from the first to the second.
    pub(super) nearest: [usize; 2],
    pub(super) baseline_m: Vector,
    pub(super) rad_m: f64,
}

impl<const CHANNELS: usize> Sighting<CHANNELS> {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        target: 0,
        position_m: [0.0; 2],
        phases_rad: [0.0; CHANNELS],
        weight: 0.0,
        doubtful: 0,
    };
}

impl<const CHANNELS: usize> Array<CHANNELS> {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        channels: [[[0.0; 2]; 2]; CHANNELS],
        used: 0,
        centre_m: [0.0; 2],
        nearest: [0; 2],
        baseline_m: [0.0; 2],
        rad_m: 0.0,
    };

    /// Transmitter and receiver of each channel in use.
    pub(super) fn channels(&self) -> impl Iterator<Item = &[Vector; 2]> + Clone {
        self.channels.iter().take(self.used)
    }

    /// Locate a target by its range and its direction of arrival (interferometric angle).
    pub(super) fn locate(&self, echo: &Echo<CHANNELS>) -> Sighting<CHANNELS> {
        let mut phases_rad = echo.phases_rad;
        let rad_m = self.rad_m;
        let apart_m = length(self.baseline_m);
        let of = |phases_rad: &[f64], c: usize| phases_rad.get(c).copied().unwrap_or(0.0);
        let [first, second] = self.nearest;
        let turns = (of(&phases_rad, second) - of(&phases_rad, first)) / TAU;
        if let Some(phase) = phases_rad.get_mut(second) {
            *phase -= TAU * libm::round(turns);
        }
        // The phase is larger at the receiver nearer to the target, since the path is shorter.
        let along = (turns - libm::round(turns)) * TAU / (rad_m * apart_m);
        // At endfire the phase has no slope over angle. Limit what noise causes to just below endfire.
        let along = along.clamp(-0.999, 0.999);
        let axis = times(self.baseline_m, 1.0 / apart_m);
        let ahead = match axis[0] < 0.0 {
            true => [axis[1], -axis[0]],
            false => [-axis[1], axis[0]],
        };
        let from = plus(
            times(axis, along),
            times(ahead, libm::sqrt(1.0 - along * along)),
        );
        let mut bearing_rad = libm::atan2(from[1], from[0]);
        // Start with the closest pair of receivers. Repeatedly add the next channel whose ambiguity is resolved.
        let mut resolved: [bool; CHANNELS] = core::array::from_fn(|c| c == first || c == second);
        let sigma = echo.phase_sigma_rad;
        loop {
            let mut line = Line::default();
            let mut errors = [[0.0; 2]; CHANNELS];
            let mut step = 0.0;
            // The first step leaves an error from curvature, the second almost nothing.
            for _ in 0..3 {
                let (sin, cos) = libm::sincos(bearing_rad);
                let position_m = plus(self.centre_m, times([cos, sin], echo.range_m));
                let across = times([-sin, cos], echo.range_m);
                line = Line::default();
                let all = self.channels().zip(&phases_rad).zip(&resolved);
                for (error, (([t, r], phase), resolved)) in errors.iter_mut().zip(all) {
                    let path_m = length(minus(position_m, *t)) + length(minus(position_m, *r));
                    let slope = plus(direction(*t, position_m), direction(*r, position_m));
                    *error = [phase + rad_m * path_m, -rad_m * dot(slope, across)];
                    if *resolved {
                        line.add(error[0], error[1]);
                    }
                }
                // Limit to one beamwidth: near endfire the slopes are small.
                step = line.slope().clamp(-0.3, 0.3);
                bearing_rad += step;
            }
            let bearing_sigma_rad = sigma / libm::sqrt(line.spread());
            let mean = line.levers / line.count;
            let doubt = |[_, lever]: [f64; 2]| {
                let by_angle = (lever - mean) * bearing_sigma_rad;
                AMBIGUITY_SIGMAS
                    * libm::sqrt(by_angle * by_angle + sigma * sigma * (1.0 + 1.0 / line.count))
            };
            let offset = (line.errors - line.levers * step) / line.count;
            let unwrapped = |phase: f64, [error, lever]: [f64; 2]| {
                let turns = (error - lever * step - offset) / TAU;
                phase - TAU * libm::round(turns)
            };
            let mut left = errors.iter().zip(&mut phases_rad).zip(&mut resolved);
            let next = (left.by_ref().take(self.used))
                .filter(|(_, resolved)| !**resolved)
                .min_by(|a, b| doubt(*a.0.0).total_cmp(&doubt(*b.0.0)));
            match next {
                Some(((error, phase), resolved)) if doubt(*error) < PI => {
                    *phase = unwrapped(*phase, *error);
                    *resolved = true;
                }
                _ => {
                    let all = errors.iter().zip(&mut phases_rad).zip(&resolved);
                    let mut doubtful = 0;
                    for ((error, phase), _) in
                        all.take(self.used).filter(|(_, resolved)| !**resolved)
                    {
                        *phase = unwrapped(*phase, *error);
                        doubtful += 1;
                    }
                    let (sin, cos) = libm::sincos(bearing_rad);
                    return Sighting {
                        target: echo.target,
                        position_m: plus(self.centre_m, times([cos, sin], echo.range_m)),
                        phases_rad,
                        weight: 1.0 / (sigma * sigma),
                        doubtful,
                    };
                }
            }
        }
    }

    /// Shift the phases of `after` to continue those of `before` under the expected motion. The flag is true if the
    /// ambiguity is in doubt.
    pub(super) fn continued(
        &self,
        before: &Sighting<CHANNELS>,
        after: &Sighting<CHANNELS>,
        motion: &Increment,
    ) -> (Sighting<CHANNELS>, bool) {
        let (mut expected, mut mean) = (0.0, 0.0);
        let count = self.used as f64;
        let path = |[t, r]: [Vector; 2]| {
            length(minus(before.position_m, t)) + length(minus(before.position_m, r))
        };
        let phases = after.phases_rad.iter().zip(&before.phases_rad);
        for (channel, (after, before)) in self.channels().zip(phases) {
            let moved =
                channel.map(|antenna| plus(rotated(antenna, motion.turn_rad), motion.moved_m));
            expected -= self.rad_m * (path(moved) - path(*channel)) / count;
            mean += (after - before) / count;
        }
        let off = mean - expected;
        let turns = TAU * libm::round(off / TAU);
        let mut moved = *after;
        moved
            .phases_rad
            .iter_mut()
            .for_each(|phase| *phase -= turns);
        (moved, (off - turns).abs() > WRAP_LIMIT * PI)
    }
}
