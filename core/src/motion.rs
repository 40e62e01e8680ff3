//! A radar's motion from pulse to pulse, of the phases of its echoes (MPGA), so that increments can be sent instead of pulses.
//!
//! **Equation** (Chim 2018, (7.17)-(7.21)). Of channels `i` in a pulse and `j` in the next, with `s = T + R = (X, Y)` in the array's frame, the path to a target becomes shorter
//! by
//!
//! ```text
//! (phase_j - phase_i) / k  =  sin(theta) c_ij + cos(theta) m_ij                   k = 2 pi / wavelength
//! c_ij = 2 dx + (X_j - X_i) cos(Phi / 2) - (Y_j + Y_i) sin(Phi / 2)
//! m_ij = 2 dR + (Y_j - Y_i) cos(Phi / 2) + (X_j + X_i) sin(Phi / 2)
//! ```
//!
//! seen from half way between both pulses. For each pair of channels `c` and `m` are least squares over targets, of which there are two or more; `dx`, `dR` and the turn `Phi` are least squares over pairs.
//! `theta` is the mean of both pulses' directions, seen from the middle of the channels' antennas: near targets are where they are (C 7.3.5), to the second order in the antennas'
//! distance over the range. Directions come of the two nearest receivers, then of channels farther apart as their whole turns become sure (C 7.3.4).
//!
//! **Neglected**: that directions err, which makes the motion too short by `e^2 / (spread of the sines)^2` for a standard deviation `e` of sines. The host's
//! `motion::robust` removes it; increments that are to be added up over thousands of pulses at low signals should be made there.
//!
//! **Input** a pulse's [`Echo`]es: what a target is called, its range, and a phase of each channel, transmitter by transmitter, receiver by receiver; phases fall by `k` a metre of path, whole turns say nothing.
//! **Output** an [`Increment`]: along the array, ahead, and counterclockwise, in the array's frame at the former pulse. **Units** metres, radians. **Memory** [`Pairwise::BYTES`].
//! **Cost** targets times channels squared, a square root each. **Accuracy** (`tests/stream/motion.rs`) the host's own increments to rounding; the same bits on every machine (`selftest::MotionSelfTest`). **Errors** [`MotionError`].

use core::f64::consts::{PI, TAU};
use core::fmt;

/// Standard deviations of doubt that whole turns must be told through.
const SURE: f64 = 3.0;
/// A phase so far from where it was expected, in parts of half a turn, may be one that wrapped.
const WRAPPED: f64 = 0.6;

/// Antennas on a rigid body, in its own frame: x along the array, y where it looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antennas<'a> {
    /// Transmitters, metres.
    pub transmitters_m: &'a [[f64; 2]],
    /// Receivers, metres.
    pub receivers_m: &'a [[f64; 2]],
    /// Wavelength at which phases are told.
    pub wavelength_m: f64,
}

/// A target in a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo<const CHANNELS: usize> {
    /// What it is called.
    pub target: u16,
    /// Half of the mean path, metres.
    pub range_m: f64,
    /// Of each channel.
    pub phases_rad: [f64; CHANNELS],
    /// Standard deviation of each of them.
    pub phase_sigma_rad: f64,
}

/// How the radar moved from a pulse to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Along the array and ahead, metres.
    pub moved_m: [f64; 2],
    /// Counterclockwise, radians.
    pub turn_rad: f64,
}

/// What two pulses told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// From the former to the latter.
    pub increment: Increment,
    /// Targets that both saw.
    pub targets: usize,
    /// Phases that may have wrapped.
    pub doubtful: usize,
}

/// Why there is no increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MotionError {
    /// Transmitters times receivers are not as many channels, or receivers less than two.
    Channels,
    /// A place or the wavelength is no number, or the nearest receivers are not apart, or by more than half a wavelength.
    Array,
    /// More targets than there is room for.
    Room,
    /// A number of an echo is none, its range or deviation is not above 0, or its target is there twice.
    Echo(u16),
    /// Two targets in different directions, or more, are needed in both pulses.
    TooLittle,
}

type Vector = [f64; 2];

fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

fn times(a: Vector, by: f64) -> Vector {
    [a[0] * by, a[1] * by]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: Vector, b: Vector) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(a: Vector) -> f64 {
    libm::sqrt(dot(a, a))
}

fn rotated(a: Vector, angle_rad: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle_rad);
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1]]
}

fn direction(from: Vector, to: Vector) -> Vector {
    let apart = minus(to, from);
    times(apart, 1.0 / length(apart))
}

/// A target as one pulse tells it.
#[derive(Clone, Copy, Debug)]
struct Look<const CHANNELS: usize> {
    target: u16,
    at_m: Vector,
    /// Without wraps between channels.
    phases_rad: [f64; CHANNELS],
    weight: f64,
    doubtful: usize,
}

/// Takes pulse after pulse, each of so many targets at most, seen by so many channels.
#[derive(Clone, Debug)]
pub struct Pairwise<const TARGETS: usize, const CHANNELS: usize> {
    /// Transmitter and receiver of each.
    channels: [[Vector; 2]; CHANNELS],
    centre_m: Vector,
    /// Channels of the nearest receivers.
    nearest: [usize; 2],
    baseline_m: Vector,
    rad_m: f64,
    before: [Look<CHANNELS>; TARGETS],
    seen: Option<usize>,
    last: Increment,
}

/// Sums of a straight line through channels' errors.
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

impl<const TARGETS: usize, const CHANNELS: usize> Pairwise<TARGETS, CHANNELS> {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// # Errors
    /// [`MotionError::Channels`], [`MotionError::Array`].
    pub fn new(antennas: &Antennas<'_>) -> Result<Self, MotionError> {
        let (transmitters, receivers) = (antennas.transmitters_m, antennas.receivers_m);
        if transmitters.len() * receivers.len() != CHANNELS || receivers.len() < 2 {
            return Err(MotionError::Channels);
        }
        let mut channels = [[[0.0; 2]; 2]; CHANNELS];
        let pairs = transmitters
            .iter()
            .flat_map(|t| receivers.iter().map(move |r| [*t, *r]));
        channels
            .iter_mut()
            .zip(pairs)
            .for_each(|(to, pair)| *to = pair);
        let (mut nearest, mut baseline_m) = ([0, 1], minus(receivers[1], receivers[0]));
        for (i, a) in receivers.iter().enumerate() {
            for (j, b) in receivers.iter().enumerate().skip(i + 1) {
                let apart = minus(*b, *a);
                if length(apart) < length(baseline_m) {
                    (nearest, baseline_m) = ([i, j], apart);
                }
            }
        }
        let mean = |places: &[Vector]| {
            let sum = places.iter().fold([0.0; 2], |sum, place| plus(sum, *place));
            times(sum, 1.0 / places.len() as f64)
        };
        let half_m = 0.5 * antennas.wavelength_m;
        let apart_m = length(baseline_m);
        let places = transmitters.iter().chain(receivers).flatten();
        // To a ten-thousandth: half a wavelength is often what is meant.
        let is_near = apart_m > 0.0 && apart_m <= half_m * 1.0001;
        if !(half_m.is_finite() && is_near && places.clone().all(|x| x.is_finite())) {
            return Err(MotionError::Array);
        }
        Ok(Self {
            channels,
            centre_m: times(plus(mean(transmitters), mean(receivers)), 0.5),
            nearest,
            baseline_m,
            rad_m: TAU / antennas.wavelength_m,
            before: [Look {
                target: 0,
                at_m: [0.0; 2],
                phases_rad: [0.0; CHANNELS],
                weight: 0.0,
                doubtful: 0,
            }; TARGETS],
            seen: None,
            last: Increment::default(),
        })
    }

    /// Takes the next pulse, and tells how the radar moved since the one before; nothing of the first.
    ///
    /// # Errors
    /// [`MotionError::Room`], [`MotionError::Echo`]: the pulse is as if it had not been. [`MotionError::TooLittle`]: the next pulse will be compared with this one.
    pub fn push(&mut self, echoes: &[Echo<CHANNELS>]) -> Result<Option<Moved>, MotionError> {
        if echoes.len() > TARGETS {
            return Err(MotionError::Room);
        }
        for (i, echo) in echoes.iter().enumerate() {
            let is_known = |x: f64| x.is_finite() && x > 0.0;
            let all = echo.phases_rad.iter().all(|phase| phase.is_finite());
            let twice = echoes
                .iter()
                .take(i)
                .any(|other| other.target == echo.target);
            if !(all && is_known(echo.range_m) && is_known(echo.phase_sigma_rad)) || twice {
                return Err(MotionError::Echo(echo.target));
            }
        }
        let former = self.before;
        let seen = self.seen.replace(echoes.len());
        for (to, echo) in self.before.iter_mut().zip(echoes) {
            *to = look(
                &self.channels,
                self.centre_m,
                self.nearest,
                self.baseline_m,
                self.rad_m,
                echo,
            );
        }
        let Some(seen) = seen else {
            return Ok(None);
        };
        let mut pairs = former;
        let (mut count, mut doubtful) = (0, 0);
        let mut after = self.before;
        for look in self.before.iter().take(echoes.len()) {
            doubtful += look.doubtful;
            let known = former
                .iter()
                .take(seen)
                .find(|former| former.target == look.target);
            let Some(known) = known else { continue };
            let (moved, wrapped) = self.continued(known, look);
            doubtful += usize::from(wrapped);
            if let (Some(to), Some(next)) = (pairs.get_mut(count), after.get_mut(count)) {
                (*to, *next) = (*known, moved);
                count += 1;
            }
        }
        let both = pairs.iter().zip(&after).take(count);
        let increment = self.solve(both).ok_or(MotionError::TooLittle)?;
        self.last = increment;
        Ok(Some(Moved {
            increment,
            targets: count,
            doubtful,
        }))
    }

    /// A look whose phases go on as the last motion makes them expected, and whether whole turns are in doubt.
    fn continued(&self, before: &Look<CHANNELS>, after: &Look<CHANNELS>) -> (Look<CHANNELS>, bool) {
        let (mut expected, mut mean) = (0.0, 0.0);
        let path =
            |[t, r]: [Vector; 2]| length(minus(before.at_m, t)) + length(minus(before.at_m, r));
        for (c, channel) in self.channels.iter().enumerate() {
            let moved = channel
                .map(|antenna| plus(rotated(antenna, self.last.turn_rad), self.last.moved_m));
            expected -= self.rad_m * (path(moved) - path(*channel)) / CHANNELS as f64;
            mean += (after.phases_rad[c] - before.phases_rad[c]) / CHANNELS as f64;
        }
        let off = mean - expected;
        let turns = TAU * libm::round(off / TAU);
        let mut moved = *after;
        moved
            .phases_rad
            .iter_mut()
            .for_each(|phase| *phase -= turns);
        (moved, (off - turns).abs() > WRAPPED * PI)
    }

    /// The two least squares; none if the targets do not tell the motion.
    fn solve<'a>(
        &self,
        pairs: impl Iterator<Item = (&'a Look<CHANNELS>, &'a Look<CHANNELS>)> + Clone,
    ) -> Option<Increment> {
        let sum = |channel: &[Vector; 2]| plus(channel[0], channel[1]);
        let all = self
            .channels
            .iter()
            .fold([0.0; 2], |all, channel| plus(all, sum(channel)));
        let mean = times(all, 1.0 / CHANNELS as f64);
        let (mut centre, mut across, mut arms) = ([0.0; 2], 0.0, 0.0);
        for (i, from) in self.channels.iter().enumerate() {
            for (j, to) in self.channels.iter().enumerate() {
                let transmitter = times(plus(from[0], to[0]), 0.5);
                let receiver = times(plus(from[1], to[1]), 0.5);
                let middle = times(plus(transmitter, receiver), 0.5);
                let (mut ss, mut sc, mut cc, mut right) = (0.0, 0.0, 0.0, [0.0; 2]);
                for (before, after) in pairs.clone() {
                    let at_m = times(plus(before.at_m, after.at_m), 0.5);
                    let u = direction(middle, at_m);
                    // Each leg has a direction of its own.
                    let legs = dot(
                        minus(direction(transmitter, at_m), u),
                        minus(to[0], from[0]),
                    ) + dot(minus(direction(receiver, at_m), u), minus(to[1], from[1]));
                    let shorter = (after.phases_rad[j] - before.phases_rad[i]) / self.rad_m - legs;
                    ss += after.weight * u[0] * u[0];
                    sc += after.weight * u[0] * u[1];
                    cc += after.weight * u[1] * u[1];
                    right = plus(right, times(u, after.weight * shorter));
                }
                let (trace, determinant) = (ss + cc, ss * cc - sc * sc);
                // Directions that differ by less than a hundredth or so of a radian are one.
                if determinant.is_nan() || determinant <= 1e-5 * trace * trace {
                    return None;
                }
                let left = [
                    (cc * right[0] - sc * right[1]) / determinant,
                    (ss * right[1] - sc * right[0]) / determinant,
                ];
                let arm = minus(plus(sum(from), sum(to)), times(mean, 2.0));
                centre = plus(centre, times(left, 1.0 / (CHANNELS * CHANNELS) as f64));
                across += cross(arm, minus(plus(left, sum(from)), sum(to)));
                arms += dot(arm, arm);
            }
        }
        let half_rad = libm::asin((across / arms).clamp(-1.0, 1.0));
        let sin = libm::sin(half_rad);
        // The mean of all channels goes where the turn takes it; the rest is the origin's. Then from half way back into the former frame.
        let origin = minus(times(centre, 0.5), times([-mean[1], mean[0]], sin));
        let moved_m = rotated(origin, half_rad);
        let is_known = moved_m.iter().all(|x| x.is_finite()) && half_rad.is_finite();
        is_known.then_some(Increment {
            moved_m,
            turn_rad: 2.0 * half_rad,
        })
    }
}

/// Where a target lies, by its range and the angle at which its echo arrives.
fn look<const CHANNELS: usize>(
    channels: &[[Vector; 2]; CHANNELS],
    centre_m: Vector,
    [first, second]: [usize; 2],
    baseline_m: Vector,
    rad_m: f64,
    echo: &Echo<CHANNELS>,
) -> Look<CHANNELS> {
    let mut phases_rad = echo.phases_rad;
    let turns = (phases_rad[second] - phases_rad[first]) / TAU;
    phases_rad[second] -= TAU * libm::round(turns);
    // Nearer to the target the phase is larger, for the path is shorter.
    let along = (turns - libm::round(turns)) * TAU / (rad_m * length(baseline_m));
    // Along the array nothing tells the angle: what noise puts there is a little off it.
    let along = along.clamp(-0.999, 0.999);
    let axis = times(baseline_m, 1.0 / length(baseline_m));
    let ahead = match axis[0] < 0.0 {
        true => [axis[1], -axis[0]],
        false => [-axis[1], axis[0]],
    };
    let from = plus(
        times(axis, along),
        times(ahead, libm::sqrt(1.0 - along * along)),
    );
    let mut bearing_rad = libm::atan2(from[1], from[0]);
    let mut told = [false; CHANNELS];
    (told[first], told[second]) = (true, true);
    let sigma = echo.phase_sigma_rad;
    loop {
        let mut line = Line::default();
        let mut errors = [[0.0; 2]; CHANNELS];
        let mut step = 0.0;
        // The first step leaves a curvature's share, the second next to nothing.
        for _ in 0..3 {
            let (sin, cos) = libm::sincos(bearing_rad);
            let at_m = plus(centre_m, times([cos, sin], echo.range_m));
            let across = times([-sin, cos], echo.range_m);
            line = Line::default();
            for (c, [t, r]) in channels.iter().enumerate() {
                let path_m = length(minus(at_m, *t)) + length(minus(at_m, *r));
                let slope = plus(direction(*t, at_m), direction(*r, at_m));
                errors[c] = [phases_rad[c] + rad_m * path_m, -rad_m * dot(slope, across)];
                if told[c] {
                    line.add(errors[c][0], errors[c][1]);
                }
            }
            // A beam's width at most: near the array's own line levers are short.
            step = line.slope().clamp(-0.3, 0.3);
            bearing_rad += step;
        }
        let bearing_sigma_rad = sigma / libm::sqrt(line.spread());
        let mean = line.levers / line.count;
        let doubt = |[_, lever]: [f64; 2]| {
            let by_angle = (lever - mean) * bearing_sigma_rad;
            SURE * libm::sqrt(by_angle * by_angle + sigma * sigma * (1.0 + 1.0 / line.count))
        };
        let next = (0..CHANNELS)
            .filter(|&c| !told[c])
            .min_by(|&a, &b| doubt(errors[a]).total_cmp(&doubt(errors[b])));
        let offset = (line.errors - line.levers * step) / line.count;
        let mut unwrap = |c: usize| {
            let turns = (errors[c][0] - errors[c][1] * step - offset) / TAU;
            phases_rad[c] -= TAU * libm::round(turns);
        };
        match next {
            Some(c) if doubt(errors[c]) < PI => {
                unwrap(c);
                told[c] = true;
            }
            _ => {
                (0..CHANNELS).filter(|&c| !told[c]).for_each(&mut unwrap);
                let (sin, cos) = libm::sincos(bearing_rad);
                return Look {
                    target: echo.target,
                    at_m: plus(centre_m, times([cos, sin], echo.range_m)),
                    phases_rad,
                    weight: 1.0 / (sigma * sigma),
                    doubtful: told.iter().filter(|told| !**told).count(),
                };
            }
        }
    }
}

impl fmt::Display for MotionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channels => f.write_str(
                "transmitters times receivers must be as many as there are channels, and receivers two or more",
            ),
            Self::Array => f.write_str(
                "places must be numbers, the wavelength above 0, and the nearest receivers at most half of it apart",
            ),
            Self::Room => f.write_str("there are more targets than there is room for"),
            Self::Echo(target) => write!(
                f,
                "target {target}: a phase, its range or its standard deviation is no number or not above 0, or it is there twice"
            ),
            Self::TooLittle => f.write_str(
                "two targets in different directions, or more, are needed in both pulses",
            ),
        }
    }
}

impl core::error::Error for MotionError {}
