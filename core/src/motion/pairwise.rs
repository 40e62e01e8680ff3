//! Increments from pulse to pulse by two least squares, of the ranges and phases of named targets.
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

use core::f64::consts::TAU;
use core::fmt;

use super::arrival::{Body, Look};
use super::plane::{Vector, cross, direction, dot, length, minus, plus, rotated, times};

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
    /// Of each channel; of channels that the antennas do not make, whatever.
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
    /// What the first least squares leave of a path, metres: weighted RMS over targets and pairs of channels, for the degrees of freedom there are. 0 if two
    /// targets saw both, for they leave nothing.
    pub residual_m: f64,
}

/// Why there is no increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MotionError {
    /// Transmitters times receivers are none or more than there is room for, or receivers less than two.
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

/// Takes pulse after pulse, each of so many targets at most, seen by so many channels.
#[derive(Clone, Debug)]
pub struct Pairwise<const TARGETS: usize, const CHANNELS: usize> {
    body: Body<CHANNELS>,
    before: [Look<CHANNELS>; TARGETS],
    seen: Option<usize>,
    last: Increment,
}

impl<const TARGETS: usize, const CHANNELS: usize> Pairwise<TARGETS, CHANNELS> {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Of no channel: what fills empty storage.
    pub(super) const EMPTY: Self = Self {
        body: Body::EMPTY,
        before: [Look::EMPTY; TARGETS],
        seen: None,
        last: Increment {
            moved_m: [0.0; 2],
            turn_rad: 0.0,
        },
    };

    /// # Errors
    /// [`MotionError::Channels`], [`MotionError::Array`].
    pub fn new(antennas: &Antennas<'_>) -> Result<Self, MotionError> {
        let (transmitters, receivers) = (antennas.transmitters_m, antennas.receivers_m);
        let used = transmitters.len().saturating_mul(receivers.len());
        if used == 0 || used > CHANNELS || receivers.len() < 2 {
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
        let (mut nearest, mut baseline_m) = ([0, 1], [f64::INFINITY; 2]);
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
            body: Body {
                channels,
                used,
                centre_m: times(plus(mean(transmitters), mean(receivers)), 0.5),
                nearest,
                baseline_m,
                rad_m: TAU / antennas.wavelength_m,
            },
            before: [Look::EMPTY; TARGETS],
            seen: None,
            last: Increment::default(),
        })
    }

    /// As if no pulse had come.
    pub fn forget(&mut self) {
        self.seen = None;
        self.last = Increment::default();
    }

    /// Takes the next pulse, and tells how the radar moved since the one before; nothing of the first.
    ///
    /// # Errors
    /// [`MotionError::Room`], [`MotionError::Echo`]: the pulse is as if it had not been. [`MotionError::TooLittle`]: the next pulse will be compared with this one.
    pub fn push(&mut self, echoes: &[Echo<CHANNELS>]) -> Result<Option<Moved>, MotionError> {
        self.push_after(echoes, 1)
    }

    /// As [`Pairwise::push`] of the pulse `pulses` after the one before: those between were lost, and whole turns are those of as many steps.
    ///
    /// # Errors
    /// As [`Pairwise::push`].
    pub fn push_after(
        &mut self,
        echoes: &[Echo<CHANNELS>],
        pulses: u32,
    ) -> Result<Option<Moved>, MotionError> {
        if echoes.len() > TARGETS {
            return Err(MotionError::Room);
        }
        for (i, echo) in echoes.iter().enumerate() {
            let is_known = |x: f64| x.is_finite() && x > 0.0;
            let mut phases = echo.phases_rad.iter().take(self.body.used);
            let all = phases.all(|phase| phase.is_finite());
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
            *to = self.body.look(echo);
        }
        let Some(seen) = seen else {
            return Ok(None);
        };
        let steps = f64::from(pulses.max(1));
        let expected = Increment {
            moved_m: times(self.last.moved_m, steps),
            turn_rad: self.last.turn_rad * steps,
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
            let (moved, wrapped) = self.body.continued(known, look, &expected);
            doubtful += usize::from(wrapped);
            if let (Some(to), Some(next)) = (pairs.get_mut(count), after.get_mut(count)) {
                (*to, *next) = (*known, moved);
                count += 1;
            }
        }
        let both = pairs.iter().zip(&after).take(count);
        let (increment, residual_m) = solve(&self.body, both).ok_or(MotionError::TooLittle)?;
        self.last = Increment {
            moved_m: times(increment.moved_m, 1.0 / steps),
            turn_rad: increment.turn_rad / steps,
        };
        Ok(Some(Moved {
            increment,
            targets: count,
            doubtful,
            residual_m,
        }))
    }
}

/// The two least squares, and what the first leaves of a path, metres; none if the targets do not tell the motion.
fn solve<'a, const CHANNELS: usize>(
    body: &Body<CHANNELS>,
    pairs: impl Iterator<Item = (&'a Look<CHANNELS>, &'a Look<CHANNELS>)> + Clone,
) -> Option<(Increment, f64)> {
    let count = body.used as f64;
    let sum = |channel: &[Vector; 2]| plus(channel[0], channel[1]);
    let all = body
        .channels()
        .fold([0.0; 2], |all, channel| plus(all, sum(channel)));
    let mean = times(all, 1.0 / count);
    let (mut centre, mut across, mut arms) = ([0.0; 2], 0.0, 0.0);
    // What is left, squared; and of how much weight. Two targets leave nothing.
    let (mut rest, mut weights) = (0.0, 0.0);
    let targets = pairs.clone().count() as f64;
    for (i, from) in body.channels().enumerate() {
        for (j, to) in body.channels().enumerate() {
            let transmitter = times(plus(from[0], to[0]), 0.5);
            let receiver = times(plus(from[1], to[1]), 0.5);
            let middle = times(plus(transmitter, receiver), 0.5);
            let (mut ss, mut sc, mut cc, mut right) = (0.0, 0.0, 0.0, [0.0; 2]);
            let mut squares = 0.0;
            for (before, after) in pairs.clone() {
                let at_m = times(plus(before.at_m, after.at_m), 0.5);
                let u = direction(middle, at_m);
                // Each leg has a direction of its own.
                let legs = dot(
                    minus(direction(transmitter, at_m), u),
                    minus(to[0], from[0]),
                ) + dot(minus(direction(receiver, at_m), u), minus(to[1], from[1]));
                let told = (after.phases_rad.get(j), before.phases_rad.get(i));
                let (Some(after_rad), Some(before_rad)) = told else {
                    return None;
                };
                let shorter = (after_rad - before_rad) / body.rad_m - legs;
                ss += after.weight * u[0] * u[0];
                sc += after.weight * u[0] * u[1];
                cc += after.weight * u[1] * u[1];
                right = plus(right, times(u, after.weight * shorter));
                squares += after.weight * shorter * shorter;
                weights += after.weight * (targets - 2.0) / targets;
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
            rest += squares - dot(left, right);
            let arm = minus(plus(sum(from), sum(to)), times(mean, 2.0));
            centre = plus(centre, times(left, 1.0 / (count * count)));
            across += cross(arm, minus(plus(left, sum(from)), sum(to)));
            arms += dot(arm, arm);
        }
    }
    let half_rad = libm::asin((across / arms).clamp(-1.0, 1.0));
    let sin = libm::sin(half_rad);
    // The mean of all channels goes where the turn takes it; the rest is the origin's. Then from half way back into the former frame.
    let origin = minus(times(centre, 0.5), times([-mean[1], mean[0]], sin));
    let moved_m = rotated(origin, half_rad);
    let residual_m = match targets > 2.0 {
        true => libm::sqrt((rest / weights).max(0.0)),
        false => 0.0,
    };
    let is_known = moved_m.iter().all(|x| x.is_finite()) && half_rad.is_finite();
    is_known.then_some((
        Increment {
            moved_m,
            turn_rad: 2.0 * half_rad,
        },
        residual_m,
    ))
}

impl fmt::Display for MotionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channels => f.write_str(
                "transmitters times receivers must be at most as many as there is room for channels, and receivers two or more",
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
