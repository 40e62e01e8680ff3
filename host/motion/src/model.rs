//! Measurement model: phases and ranges of targets from poses, target positions and the array.
//!
//! ```text
//! path_c(i, n) = |P_i - T_c| + |P_i - R_c|,      T_c, R_c = p_n + turned(heading_n) (antennas of channel c)
//! phase_c      = beta_i - 2 pi (path_c - path_i) / wavelength
//! range        = mean over channels of path_c / 2
//! ```
//!
//! `path_i` is the mean path to the target from a reference pose, and `beta_i` the phase there. Referring phases to that pose decouples the phase of a target from its range, which a phase at path 0 would not.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// Antenna array on a rigid body, in the body's frame: x along the array, y along boresight.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Positions of the transmitters, metres.
    pub transmitters_m: Vec<DVec2>,
    /// Positions of the receivers, metres.
    pub receivers_m: Vec<DVec2>,
    /// Wavelength of the phases, metres.
    pub wavelength_m: f64,
}

/// Position and heading of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position of the body's origin, metres.
    pub at_m: DVec2,
    /// Angle from the frame's x axis to the body's, radians, counterclockwise.
    pub heading_rad: f64,
}

/// Point target with the phase of its echo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Position in the frame of the poses, metres.
    pub at_m: DVec2,
    /// Mean phase of its echo at the reference pose, radians.
    pub phase_rad: f64,
    /// Reference pose of the phase.
    pub from: Pose,
}

/// Measurement of a target in a pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// Number of the target.
    pub target: usize,
    /// Range, metres: half of the mean path over channels.
    pub range_m: f64,
    /// Standard deviation of the range, metres.
    pub range_sigma_m: f64,
    /// Phase of each channel, radians, transmitter by transmitter, receiver by receiver; ambiguous by whole turns.
    pub phases_rad: Vec<f64>,
    /// Standard deviation of each phase, radians.
    pub phase_sigma_rad: f64,
}

/// Model value of a measurement with its derivatives by pose (x, y, heading) and target (x, y, phase).
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Model value, radians or metres.
    pub value: f64,
    /// Derivatives by the pose.
    pub pose: DVec3,
    /// Derivatives by the target.
    pub target: DVec3,
}

/// Path from a transmitter over a target to a receiver.
pub(crate) struct Path {
    pub(crate) length_m: f64,
    /// Derivative by the target's position; by the radar's position it is the negative.
    pub(crate) slope: DVec2,
    /// Derivative by the heading, metres a radian.
    pub(crate) turn_m: f64,
}

impl Array {
    /// Transmitter and receiver of each channel: every transmitter with every receiver.
    pub fn channels(&self) -> impl Iterator<Item = [DVec2; 2]> {
        let each = self.transmitters_m.iter();
        each.flat_map(|&t| self.receivers_m.iter().map(move |&r| [t, r]))
    }

    /// Number of channels, transmitters times receivers.
    pub fn num_channels(&self) -> usize {
        self.transmitters_m.len() * self.receivers_m.len()
    }

    /// Phase centre of the array, metres: the mean of the mean transmitter and the mean receiver. Ranges refer to it, up to the square of the antenna spacing over twice the range.
    pub fn centre_m(&self) -> DVec2 {
        let mean = |places: &[DVec2]| places.iter().sum::<DVec2>() / places.len() as f64;
        0.5 * (mean(&self.transmitters_m) + mean(&self.receivers_m))
    }

    /// Wavenumber, radians a metre of path.
    pub fn rad_m(&self) -> f64 {
        TAU / self.wavelength_m
    }

    /// Model of a sighting: the phases of its channels, then its range.
    pub fn lines(&self, pose: &Pose, target: &Target) -> Vec<Line> {
        let mean = |paths: &[Path]| {
            let share = 1.0 / paths.len() as f64;
            let length_m = paths.iter().map(|path| path.length_m).sum::<f64>();
            let slope = paths.iter().map(|path| path.slope).sum::<DVec2>();
            let turn_m = paths.iter().map(|path| path.turn_m).sum::<f64>();
            (share * length_m, share * slope, share * turn_m)
        };
        let (seen_m, seen_slope, _) = mean(&self.paths(&target.from, target.at_m));
        let paths = self.paths(pose, target.at_m);
        let (mean_m, slope, turn_m) = mean(&paths);
        let k = self.rad_m();
        let phases = paths.iter().map(|path| {
            let with = -k * (path.slope - seen_slope);
            Line {
                value: target.phase_rad - k * (path.length_m - seen_m),
                pose: (k * path.slope).extend(-k * path.turn_m),
                target: with.extend(1.0),
            }
        });
        let range = Line {
            value: 0.5 * mean_m,
            pose: (-0.5 * slope).extend(0.5 * turn_m),
            target: (0.5 * slope).extend(0.0),
        };
        phases.chain(std::iter::once(range)).collect()
    }

    /// Paths of all channels.
    pub(crate) fn paths(&self, pose: &Pose, at_m: DVec2) -> Vec<Path> {
        let (sin, cos) = libm::sincos(pose.heading_rad);
        let turned = |a: DVec2| DVec2::new(cos * a.x - sin * a.y, sin * a.x + cos * a.y);
        let leg = |antenna_m: DVec2| {
            let arm = turned(antenna_m);
            let from = at_m - (pose.at_m + arm);
            let length = from.length();
            let u = from / length;
            // The antenna moves across its lever arm.
            (length, u, -u.dot(arm.perp()))
        };
        let each = self.channels().map(|channel| {
            let [(a, u, turn_u), (b, v, turn_v)] = channel.map(leg);
            Path {
                length_m: a + b,
                slope: u + v,
                turn_m: turn_u + turn_v,
            }
        });
        each.collect()
    }

    /// The two nearest receivers of one transmitter: their channels, and the baseline from the first to the second, metres.
    pub fn shortest_baseline(&self) -> Option<([usize; 2], DVec2)> {
        let receivers = &self.receivers_m;
        let pairs =
            (0..receivers.len()).flat_map(|i| (i + 1..receivers.len()).map(move |j| [i, j]));
        pairs
            .map(|[i, j]| ([i, j], receivers[j] - receivers[i]))
            .min_by(|a, b| a.1.length().total_cmp(&b.1.length()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn model_derivatives_equal_central_differences() {
        let array = Array {
            transmitters_m: vec![DVec2::new(-0.03, 0.01), DVec2::new(0.1, 0.0)],
            receivers_m: vec![DVec2::ZERO, DVec2::new(0.002, 0.0), DVec2::new(0.0, 0.05)],
            wavelength_m: 0.004,
        };
        let pose = Pose {
            at_m: DVec2::new(0.3, -0.1),
            heading_rad: 0.2,
        };
        let target = Target {
            at_m: DVec2::new(1.5, 3.0),
            phase_rad: 0.7,
            from: Pose {
                at_m: DVec2::new(0.1, 0.2),
                heading_rad: -0.1,
            },
        };
        let lines = array.lines(&pose, &target);
        assert_eq!(lines.len(), 7);
        let h = 1e-6;
        let moved = |i: usize, by: f64| {
            let (mut pose, mut target) = (pose, target);
            match i {
                0 => pose.at_m.x += by,
                1 => pose.at_m.y += by,
                2 => pose.heading_rad += by,
                3 => target.at_m.x += by,
                4 => target.at_m.y += by,
                _ => target.phase_rad += by,
            }
            array.lines(&pose, &target)
        };
        for i in 0..6 {
            let (after, before) = (moved(i, h), moved(i, -h));
            for (c, line) in lines.iter().enumerate() {
                let derivative = (after[c].value - before[c].value) / (2.0 * h);
                let analytic = [line.pose, line.target][i / 3].to_array()[i % 3];
                // Second differences and the rounding of a phase of 1e4 rad over a step of 1e-6.
                assert!(
                    (derivative - analytic).abs() < 1e-4 * analytic.abs().max(1.0),
                    "{c} {i}: {derivative} {analytic}"
                );
            }
        }
    }
}
