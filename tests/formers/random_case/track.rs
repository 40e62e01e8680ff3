//! Random tracks: antenna positions by pulse.

use std::f64::consts::TAU;

use glam::DVec3;

use super::draw::Random;

/// Shape of the phase centre's track, over `u` from -1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Uniform motion along a line.
    Straight,
    /// A parabola: sagitta relative to half the length.
    Curved(f64),
    /// A circle about the vertical through the scene's origin; degrees from end to end.
    Circle(f64),
    /// A corner at `u`, by an angle in degrees.
    Corner(f64, f64),
    /// Sway with this many cycles from end to end.
    Sway(f64),
    /// Independent jitter of each pulse.
    Jitter,
    /// Jitter on a tenth of the track from `u` on.
    RoughStretch(f64),
    /// Stop and go: this many pulses at each position.
    StopAndGo(usize),
    /// A gap of half the length at `u`.
    Gap(f64),
    /// One pulse far off the track.
    Outlier(f64),
}

/// Arrangement of antennas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Antennas {
    /// Monostatic antenna on one track.
    Monostatic,
    /// A receiver at this offset from the transmitter.
    Apart(DVec3),
    /// A stationary transmitter at this position.
    Still(DVec3),
    /// Alternating receivers: their number, and the offset between neighbours.
    InTurn(usize, DVec3),
}

/// A track: shape, place, antennas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Track {
    pub(crate) shape: Shape,
    /// Centre of the track, metres.
    pub(crate) middle_m: DVec3,
    /// Unit vector of the direction of flight.
    pub(crate) along: DVec3,
    /// Distance from end to end, metres.
    pub(crate) length_m: f64,
    /// Size of sway, jitter or outlier, metres.
    pub(crate) amplitude_m: f64,
    pub(crate) antennas: Antennas,
    /// Offset of reference paths from those of the scene's origin, metres; if infinite, reference paths are zero.
    pub(crate) reference_m: f64,
    /// Seed of the position jitter.
    pub(crate) seed: u64,
}

impl Track {
    /// Transmitter and receiver of pulse `n` of `count`.
    pub(crate) fn at(&self, n: usize, count: usize) -> [DVec3; 2] {
        let place = |n: usize| match count {
            1 => 0.0,
            _ => 2.0 * n as f64 / (count as f64 - 1.0) - 1.0,
        };
        let half_m = self.length_m / 2.0;
        let across = self.along.any_orthonormal_vector();
        let other = self.along.cross(across);
        let mut random = Random::new(self.seed ^ (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut jitter = || {
            let [x, y, z] = [(); 3].map(|()| random.normal());
            DVec3::new(x, y, z) * self.amplitude_m
        };
        let u = place(n);
        let straight = self.middle_m + self.along * (u * half_m);
        let centre = match self.shape {
            Shape::Straight => straight,
            Shape::Curved(sagitta) => straight + across * (sagitta * half_m * u * u),
            Shape::Circle(degrees) => {
                let (sin, cos) = (u * degrees.to_radians() / 2.0).sin_cos();
                let DVec3 { x, y, z } = self.middle_m;
                DVec3::new(x * cos - y * sin, x * sin + y * cos, z)
            }
            Shape::Corner(corner, degrees) => {
                let past = (u - corner).max(0.0) * half_m;
                let (sin, cos) = degrees.to_radians().sin_cos();
                straight + (self.along * (cos - 1.0) + other * sin) * past
            }
            Shape::Sway(cycles) => {
                let angle = TAU * cycles * (u + 1.0) / 2.0;
                straight
                    + (across * angle.sin() + other * (0.7 * angle + 1.0).cos()) * self.amplitude_m
            }
            Shape::Jitter => straight + jitter(),
            Shape::RoughStretch(from) if (from..from + 0.2).contains(&u) => straight + jitter(),
            Shape::RoughStretch(_) => straight,
            Shape::StopAndGo(pulses) => {
                self.middle_m + self.along * (place(n / pulses * pulses) * half_m)
            }
            Shape::Gap(from) if u > from => straight + self.along * half_m,
            Shape::Gap(_) => straight,
            Shape::Outlier(at) => {
                let nearest = ((at + 1.0) / 2.0 * (count as f64 - 1.0)).round() as usize;
                match n == nearest {
                    true => straight + other * self.amplitude_m,
                    false => straight,
                }
            }
        };
        match self.antennas {
            Antennas::Monostatic => [centre, centre],
            Antennas::Apart(offset) => [centre, centre + offset],
            Antennas::Still(at) => [at, centre],
            Antennas::InTurn(receivers, apart) => {
                [centre, centre + apart * ((n % receivers) as f64 + 1.0)]
            }
        }
    }

    /// Path to which pulse `n`'s phase is compensated, metres.
    pub(crate) fn reference_path_m(&self, n: usize, count: usize) -> f64 {
        if self.reference_m.is_infinite() {
            return 0.0;
        }
        let [transmitter, receiver] = self.at(n, count);
        transmitter.length() + receiver.length() + self.reference_m
    }
}
