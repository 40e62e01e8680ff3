//! MPGA pulse by pulse, by two least squares (Chim 2018, 7.3 and 7.3.5): what moves least, and drifts.
//!
//! Of channels `i` in a pulse and `j` in the next, with `s_i = T + R` of channel `i` in the array's frame, seen from the frame half way between both pulses,
//! the path becomes shorter by
//!
//! ```text
//! path_i - path_j  =  (phase_j - phase_i) / k  =  u . (2 d + turned(s_j, Phi / 2) - turned(s_i, -Phi / 2))  =  sin(theta) c_ij + cos(theta) m_ij
//! c_ij = 2 dx + (X_j - X_i) cos(Phi / 2) - (Y_j + Y_i) sin(Phi / 2)
//! m_ij = 2 dR + (Y_j - Y_i) cos(Phi / 2) + (X_j + X_i) sin(Phi / 2)           s = (X, Y),   k = 2 pi / wavelength
//! ```
//!
//! (C (7.17)-(7.21), which are in the first pulse's frame.) For each pair of channels the first least squares, over targets, finds `c_ij` and `m_ij`; the second, over pairs,
//! finds `dx`, `dR` and `Phi`.
//!
//! **Where the thesis has slips.** A row of its tensor (7.10) is the antenna of the *second* pulse, of its matrices (7.22)-(7.24) that of the first:
//! these are of the tensor transposed, and agree with it for `i = j` alone. Its turn counts clockwise, ours counterclockwise. For targets that are
//! near, (7.33) takes `sin(theta) - B / range` for `sin(theta)`, `B` being the transmitter's distance from the receiver of which `theta` is the angle. Two
//! legs make a path, of which one starts at the transmitter: of `2 dx` it is `B / 2`; and to the first order not only the sine but the direction
//! changes, by `(B / range) cos(theta)` across it. So `u` is here the direction from the middle of the channel's antennas to the place
//! ([`crate::arrival`]): what is left is of the second order, `(antennas' distance / range)^2 / 8`.
//!
//! `u` is the mean of both pulses' directions, so that the motion's own curvature is left out to the third order, `d^3 / (24 range^2)`.
//!
//! **What is neglected.** That the directions have errors. Of `theta` with standard deviation `e` the normal matrix of the first
//! least squares is too large by `e^2` a target, and `dx` too small by about `e^2 / (spread of the sines)^2`: the track is too short,
//! the more the less sure its angles, and nothing averages that ([`crate::robust`] derives and removes it). At 77 GHz, with two receivers half a wavelength apart, a metre in 1000 pulses loses
//! 0.2 mm at 30 dB beside random errors of 0.6 mm, and 6 mm at 15 dB beside 3.5 mm (`tests/increments.rs`; C 7.5.1 has 2 mm).
//!
//! **Units** metres, radians. **Cost** pairs of channels times targets. **Errors** [`MotionError`].

use glam::{DMat2, DVec2};

use crate::arrival::{self, Arrival};
use crate::check::{self, MotionError};
use crate::increment::{Heading, Increment, WRAPPED};
use crate::joint::NoEstimate;
use crate::model::{Array, Sighting};
use std::f64::consts::{PI, TAU};

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

/// Takes pulse after pulse.
pub struct Pairwise {
    array: Array,
    heading: Heading,
    before: Vec<(Arrival, usize)>,
    /// How it moved last: whole turns of the next phases follow from it.
    last: Increment,
    pulses: usize,
}

/// A target in two pulses.
struct Pair {
    /// In the array's frame half way.
    at_m: DVec2,
    before: Vec<f64>,
    after: Vec<f64>,
    weight: f64,
}

impl Pairwise {
    /// # Errors
    /// [`MotionError::Antennas`], [`MotionError::Array`], [`MotionError::Baseline`].
    pub fn new(array: Array, heading: Heading) -> Result<Self, MotionError> {
        check::array(&array)?;
        Ok(Self {
            array,
            heading,
            before: Vec::new(),
            last: Increment::default(),
            pulses: 0,
        })
    }

    /// Takes the next pulse, and tells how the radar moved since the one before; nothing of the first.
    ///
    /// # Errors
    /// [`MotionError::Sighting`]: the pulse is as if it had not been. [`NoEstimate::Pose`]: the next pulse will be compared with this one.
    pub fn push(&mut self, sightings: &[Sighting]) -> Result<Option<Moved>, MotionError> {
        check::sightings(&self.array, sightings)?;
        let number = self.pulses;
        self.pulses += 1;
        let arrivals: Vec<(Arrival, usize)> = sightings
            .iter()
            .map(|sighting| (arrival::look(&self.array, sighting), sighting.target))
            .collect();
        let before = std::mem::replace(&mut self.before, arrivals);
        if number == 0 {
            return Ok(None);
        }
        let mut doubtful = 0;
        let mut pairs = Vec::with_capacity(sightings.len());
        for ((arrival, target), sighting) in self.before.iter().zip(sightings) {
            doubtful += arrival.doubtful;
            if let Some((former, _)) = before.iter().find(|(_, name)| name == target) {
                let (pair, wrapped) = self.pair(former, arrival, sighting.phase_sigma_rad);
                doubtful += usize::from(wrapped);
                pairs.push(pair);
            }
        }
        let increment = solve(&self.array, &pairs, self.heading).ok_or(NoEstimate::Pose(number))?;
        self.last = increment;
        Ok(Some(Moved {
            increment,
            targets: pairs.len(),
            doubtful,
        }))
    }

    /// A target seen in both pulses, whole turns as the last motion makes them expected, and whether they are in doubt.
    fn pair(&self, before: &Arrival, after: &Arrival, sigma: f64) -> (Pair, bool) {
        let count = before.phases_rad.len() as f64;
        let expected = self.last.phases_rad(&self.array, before.at_m).sum::<f64>() / count;
        let differences = after.phases_rad.iter().zip(&before.phases_rad);
        let mean = differences
            .map(|(after, before)| after - before)
            .sum::<f64>()
            / count;
        let off = mean - expected;
        let turns = TAU * (off / TAU).round();
        let pair = Pair {
            at_m: 0.5 * (before.at_m + after.at_m),
            before: before.phases_rad.clone(),
            after: after.phases_rad.iter().map(|phase| phase - turns).collect(),
            weight: 1.0 / (sigma * sigma),
        };
        (pair, (off - turns).abs() > WRAPPED * PI)
    }
}

/// The two least squares; none if the targets do not tell the motion.
fn solve(array: &Array, pairs: &[Pair], heading: Heading) -> Option<Increment> {
    let channels: Vec<[DVec2; 2]> = array.channels().collect();
    let sums: Vec<DVec2> = channels.iter().map(|[t, r]| *t + *r).collect();
    let count = sums.len() as f64;
    let mean = sums.iter().sum::<DVec2>() / count;
    let k = array.rad_m();
    // Of (c, m) over pairs: the mean, and what is across their arms, which a turn makes.
    let (mut centre, mut across, mut arms) = (DVec2::ZERO, 0.0, 0.0);
    for (i, [t, from_receiver]) in channels.iter().enumerate() {
        for (j, [other, to]) in channels.iter().enumerate() {
            let [transmitter, receiver] = [0.5 * (*t + *other), 0.5 * (*from_receiver + *to)];
            let middle = 0.5 * (transmitter + receiver);
            let (mut matrix, mut right) = (DMat2::ZERO, DVec2::ZERO);
            for pair in pairs {
                let from = |antenna_m: DVec2| (pair.at_m - antenna_m).normalize_or_zero();
                let u = from(middle);
                // Each leg has a direction of its own.
                let apart = (from(transmitter) - u).dot(*other - *t)
                    + (from(receiver) - u).dot(*to - *from_receiver);
                let shorter = (pair.after[j] - pair.before[i]) / k - apart;
                matrix += DMat2::from_cols(u * u.x, u * u.y) * pair.weight;
                right += u * (shorter * pair.weight);
            }
            // Directions that differ by less than a hundredth or so of a radian are one.
            let trace = matrix.x_axis.x + matrix.y_axis.y;
            let determinant = matrix.determinant();
            if determinant.is_nan() || determinant <= 1e-5 * trace * trace {
                return None;
            }
            let left = matrix.inverse() * right;
            let arm = sums[i] + sums[j] - 2.0 * mean;
            centre += left / (count * count);
            across += arm.perp_dot(left + sums[i] - sums[j]);
            arms += arm.length_squared();
        }
    }
    let half_rad = match heading {
        Heading::Found => libm::asin((across / arms).clamp(-1.0, 1.0)),
        Heading::Held => 0.0,
    };
    let (sin, cos) = libm::sincos(half_rad);
    // The mean of all channels goes where the turn takes it; the rest is the origin's. Then from half way back into the former frame.
    let moved_m = DVec2::new(cos, sin).rotate(0.5 * centre - mean.perp() * sin);
    let turn_rad = 2.0 * half_rad;
    (moved_m.is_finite() && turn_rad.is_finite()).then_some(Increment { moved_m, turn_rad })
}
