//! Pulse-to-pulse motion increments by two least-squares fits to the ranges and phases of identified targets.
//!
//! **Equation** (Chim 2018, (7.17)-(7.21)). For channel `i` of a pulse and channel `j` of the next, with
//! `s = T + R = (X, Y)` in the array frame, the path to a target shortens by
//!
//! ```text
//! (phase_j - phase_i) / k  =  sin(theta) c_ij + cos(theta) m_ij                   k = 2 pi / wavelength
//! c_ij = 2 dx + (X_j - X_i) cos(Phi / 2) - (Y_j + Y_i) sin(Phi / 2)
//! m_ij = 2 dR + (Y_j - Y_i) cos(Phi / 2) + (X_j + X_i) sin(Phi / 2)
//! ```
//!
//! as seen from halfway between both pulses. For each pair of channels, `c` and `m` are fitted by least squares over two or
//! more targets. `dx`, `dR` and the rotation `Phi` are then fitted by least squares over the channel pairs. `theta` is the
//! mean of both pulses' directions from the centre of the channels' antennas. Targets may be in the near field
//! (C 7.3.5), to second order in the antenna spacing over the range. Directions of arrival are estimated from the closest
//! pair of receivers, then from channels farther apart as their ambiguities are resolved (C 7.3.4).
//!
//! **Neglected**: errors of the directions, which bias the motion low by `e^2 / (spread of the sines)^2` for a standard
//! deviation `e` of the sines. The host's `motion::robust` removes this bias; use it for increments that are summed over
//! thousands of pulses at low SNR.
//!
//! **Input**: the [`Echo`]es of a pulse: target identifier, range, and the phase of each channel, transmitters outermost,
//! receivers innermost. Phases decrease by `k` per metre of path and are ambiguous by whole turns. **Output**: an
//! [`Increment`] along the array, ahead, and counterclockwise, in the array frame at the earlier pulse. **Units**: metres,
//! radians. **Memory**: [`Pairwise::BYTES`]. **Cost**: targets times channels squared, one square root each.
//! **Accuracy** (`tests/stream/motion.rs`): equal to the host's increments up to rounding; bit-identical on every machine
//! (`selftest::MotionSelfTest`). **Errors**: [`MotionError`].

use core::f64::consts::TAU;
use core::fmt;

use super::arrival::{Array, Sighting};
use super::plane::{Vector, cross, direction, dot, length, minus, plus, rotated, times};

/// Antenna positions on a rigid body in its own frame: x along the array, y along boresight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antennas<'a> {
    /// Transmitter positions in metres.
    pub transmitters_m: &'a [[f64; 2]],
    /// Receiver positions in metres.
    pub receivers_m: &'a [[f64; 2]],
    /// Wavelength in metres that the phases refer to.
    pub wavelength_m: f64,
}

/// Echo of an identified target in one pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo<const CHANNELS: usize> {
    /// Target identifier.
    pub target: u16,
    /// Range in metres: half of the mean path.
    pub range_m: f64,
    /// Phase of each channel in radians. Elements beyond the channels in use are ignored.
    pub phases_rad: [f64; CHANNELS],
    /// Standard deviation of the phases in radians.
    pub phase_sigma_rad: f64,
}

/// Radar motion from one pulse to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Displacement along the array and ahead (boresight) in metres.
    pub moved_m: [f64; 2],
    /// Rotation in radians, counterclockwise.
    pub turn_rad: f64,
}

/// Motion estimate from two pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionEstimate {
    /// Motion from the earlier to the later pulse.
    pub increment: Increment,
    /// Number of targets common to both pulses.
    pub targets: usize,
    /// Number of phases near the unwrapping limit, which may be wrong by a cycle.
    pub doubtful: usize,
    /// Residual of the first least-squares fit in metres: weighted RMS over targets and channel pairs, divided by the degrees of
    /// freedom. 0 with two targets, which leave no residual.
    pub residual_m: f64,
}

/// Reason why there is no increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MotionError {
    /// Transmitters times receivers is zero or exceeds the capacity, or there are fewer than two receivers.
    Channels,
    /// A position or the wavelength is not finite, or the closest receivers coincide or are more than half a wavelength apart.
    Array,
    /// More targets than the capacity.
    Room,
    /// Invalid echo of this target: a value that is not finite, a range or standard deviation that is not positive, or a
    /// repeated target.
    Echo(u16),
    /// Fewer than two targets in different directions are common to both pulses.
    TooLittle,
}

/// Motion estimator for at most `TARGETS` targets per pulse and at most `CHANNELS` channels.
#[derive(Clone, Debug)]
pub struct Pairwise<const TARGETS: usize, const CHANNELS: usize> {
    array: Array<CHANNELS>,
    before: [Sighting<CHANNELS>; TARGETS],
    seen: Option<usize>,
    last: Increment,
}

impl<const TARGETS: usize, const CHANNELS: usize> Pairwise<TARGETS, CHANNELS> {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// No channels; initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        array: Array::EMPTY,
        before: [Sighting::EMPTY; TARGETS],
        seen: None,
        last: Increment {
            moved_m: [0.0; 2],
            turn_rad: 0.0,
        },
    };

    /// Create an estimator for an antenna array.
    ///
    /// # Errors
    /// [`MotionError::Channels`] or [`MotionError::Array`] if the array is invalid.
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
        // Tolerance of 1e-4, since half a wavelength is a common spacing.
        let is_near = apart_m > 0.0 && apart_m <= half_m * 1.0001;
        if !(half_m.is_finite() && is_near && places.clone().all(|x| x.is_finite())) {
            return Err(MotionError::Array);
        }
        Ok(Self {
            array: Array {
                channels,
                used,
                centre_m: times(plus(mean(transmitters), mean(receivers)), 0.5),
                nearest,
                baseline_m,
                rad_m: TAU / antennas.wavelength_m,
            },
            before: [Sighting::EMPTY; TARGETS],
            seen: None,
            last: Increment::default(),
        })
    }

    /// Reset to the state before the first pulse.
    pub fn forget(&mut self) {
        self.seen = None;
        self.last = Increment::default();
    }

    /// Process the next pulse and estimate the motion since the previous one. `None` for the first pulse.
    ///
    /// # Errors
    /// [`MotionError::Room`] or [`MotionError::Echo`]: the pulse is ignored. [`MotionError::TooLittle`]: the next motion is
    /// relative to this pulse.
    pub fn push(
        &mut self,
        echoes: &[Echo<CHANNELS>],
    ) -> Result<Option<MotionEstimate>, MotionError> {
        self.push_after(echoes, 1)
    }

    /// Like [`Pairwise::push`], for a pulse `pulses` after the previous one. The pulses in between were lost, and phases are
    /// unwrapped for that many steps.
    ///
    /// # Errors
    /// As for [`Pairwise::push`].
    pub fn push_after(
        &mut self,
        echoes: &[Echo<CHANNELS>],
        pulses: u32,
    ) -> Result<Option<MotionEstimate>, MotionError> {
        if echoes.len() > TARGETS {
            return Err(MotionError::Room);
        }
        for (i, echo) in echoes.iter().enumerate() {
            let is_valid = |x: f64| x.is_finite() && x > 0.0;
            let mut phases = echo.phases_rad.iter().take(self.array.used);
            let all = phases.all(|phase| phase.is_finite());
            let twice = echoes
                .iter()
                .take(i)
                .any(|other| other.target == echo.target);
            if !(all && is_valid(echo.range_m) && is_valid(echo.phase_sigma_rad)) || twice {
                return Err(MotionError::Echo(echo.target));
            }
        }
        let former = self.before;
        let seen = self.seen.replace(echoes.len());
        for (to, echo) in self.before.iter_mut().zip(echoes) {
            *to = self.array.locate(echo);
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
        for locate in self.before.iter().take(echoes.len()) {
            doubtful += locate.doubtful;
            let earlier = former
                .iter()
                .take(seen)
                .find(|former| former.target == locate.target);
            let Some(earlier) = earlier else { continue };
            let (moved, wrapped) = self.array.continued(earlier, locate, &expected);
            doubtful += usize::from(wrapped);
            if let (Some(to), Some(next)) = (pairs.get_mut(count), after.get_mut(count)) {
                (*to, *next) = (*earlier, moved);
                count += 1;
            }
        }
        let both = pairs.iter().zip(&after).take(count);
        let (increment, residual_m) = solve(&self.array, both).ok_or(MotionError::TooLittle)?;
        self.last = Increment {
            moved_m: times(increment.moved_m, 1.0 / steps),
            turn_rad: increment.turn_rad / steps,
        };
        Ok(Some(MotionEstimate {
            increment,
            targets: count,
            doubtful,
            residual_m,
        }))
    }
}

/// The two least-squares fits, and the residual of the first in metres. `None` if the targets do not determine the motion.
fn solve<'a, const CHANNELS: usize>(
    array: &Array<CHANNELS>,
    pairs: impl Iterator<Item = (&'a Sighting<CHANNELS>, &'a Sighting<CHANNELS>)> + Clone,
) -> Option<(Increment, f64)> {
    let count = array.used as f64;
    let sum = |channel: &[Vector; 2]| plus(channel[0], channel[1]);
    let all = array
        .channels()
        .fold([0.0; 2], |all, channel| plus(all, sum(channel)));
    let mean = times(all, 1.0 / count);
    let (mut centre, mut across, mut arms) = ([0.0; 2], 0.0, 0.0);
    // Squared residual and its weight. Two targets leave no residual.
    let (mut rest, mut weights) = (0.0, 0.0);
    let targets = pairs.clone().count() as f64;
    for (i, from) in array.channels().enumerate() {
        for (j, to) in array.channels().enumerate() {
            let transmitter = times(plus(from[0], to[0]), 0.5);
            let receiver = times(plus(from[1], to[1]), 0.5);
            let middle = times(plus(transmitter, receiver), 0.5);
            let (mut ss, mut sc, mut cc, mut right) = (0.0, 0.0, 0.0, [0.0; 2]);
            let mut squares = 0.0;
            for (before, after) in pairs.clone() {
                let position_m = times(plus(before.position_m, after.position_m), 0.5);
                let u = direction(middle, position_m);
                // Correct for the different directions of the two legs.
                let legs = dot(
                    minus(direction(transmitter, position_m), u),
                    minus(to[0], from[0]),
                ) + dot(
                    minus(direction(receiver, position_m), u),
                    minus(to[1], from[1]),
                );
                let phases_rad = (after.phases_rad.get(j), before.phases_rad.get(i));
                let (Some(after_rad), Some(before_rad)) = phases_rad else {
                    return None;
                };
                let shorter = (after_rad - before_rad) / array.rad_m - legs;
                ss += after.weight * u[0] * u[0];
                sc += after.weight * u[0] * u[1];
                cc += after.weight * u[1] * u[1];
                right = plus(right, times(u, after.weight * shorter));
                squares += after.weight * shorter * shorter;
                weights += after.weight * (targets - 2.0) / targets;
            }
            let (trace, determinant) = (ss + cc, ss * cc - sc * sc);
            // Directions that differ by less than about a hundredth of a radian count as equal.
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
    // Subtract the displacement of the channels' mean by the rotation to obtain that of the origin. Then rotate from the half-way frame into the earlier frame.
    let origin = minus(times(centre, 0.5), times([-mean[1], mean[0]], sin));
    let moved_m = rotated(origin, half_rad);
    let residual_m = match targets > 2.0 {
        true => libm::sqrt((rest / weights).max(0.0)),
        false => 0.0,
    };
    let is_valid = moved_m.iter().all(|x| x.is_finite()) && half_rad.is_finite();
    is_valid.then_some((
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
                "antenna channels: expected transmitters times receivers within the capacity, and at least two receivers",
            ),
            Self::Array => f.write_str(
                "antenna array: expected finite positions, a positive wavelength, and closest receivers at most half a wavelength apart",
            ),
            Self::Room => f.write_str("more targets than the capacity: pass the strongest ones only"),
            Self::Echo(target) => write!(
                f,
                "target {target}: expected finite phases, positive range and standard deviation, and one echo per target"
            ),
            Self::TooLittle => f.write_str(
                "expected two or more targets in different directions common to both pulses",
            ),
        }
    }
}

impl core::error::Error for MotionError {}
