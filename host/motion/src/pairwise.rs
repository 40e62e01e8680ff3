//! MPGA between neighbouring pulses by two linear least squares (Chim 2018, 7.3 and 7.3.5). The cheapest method; its track drifts.
//!
//! For channels `i` of a pulse and `j` of the next, with `s_i = T + R` of channel `i` in the array's frame, the path shortens in the frame half-way between the pulses by
//!
//! ```text
//! path_i - path_j  =  (phase_j - phase_i) / k  =  u . (2 d + turned(s_j, Phi / 2) - turned(s_i, -Phi / 2))  =  sin(theta) c_ij + cos(theta) m_ij
//! c_ij = 2 dx + (X_j - X_i) cos(Phi / 2) - (Y_j + Y_i) sin(Phi / 2)
//! m_ij = 2 dR + (Y_j - Y_i) cos(Phi / 2) + (X_j + X_i) sin(Phi / 2)           s = (X, Y),   k = 2 pi / wavelength
//! ```
//!
//! (C (7.17)-(7.21), which are in the first pulse's frame.) The first least squares, over targets, finds `c_ij` and `m_ij` of each pair of channels. The second, over pairs, finds `dx`, `dR` and `Phi`.
//!
//! **Corrections to the thesis.** A row of its tensor (7.10) is the antenna of the *second* pulse; a row of its matrices (7.22)-(7.24) is that of the first. The matrices are those of the transposed tensor and
//! agree with it only for `i = j`. Its turn counts clockwise, here it counts counterclockwise. For near targets (7.33) replaces `sin(theta)` by `sin(theta) - B / range`, `B` the distance of the
//! transmitter from the receiver at which `theta` is measured. Only one of the two legs of a path starts at the transmitter, so that `2 dx` takes half of that. To the first order the direction changes too, by
//! `(B / range) cos(theta)` across it. Here `u` is the direction from the middle of the channel's antennas to the target ([`crate::arrival`]); the remaining error is of second order,
//! `(antenna spacing / range)^2 / 8`.
//!
//! `u` is the mean of the directions of both pulses: the curvature of the motion is neglected from the third order on, `d^3 / (24 range^2)`.
//!
//! **Neglected: errors of the directions.** For `theta` with standard deviation `e`, the normal matrix of the first least squares is too large by `e^2` a target, and `dx` is too small by about
//! `e^2 / (spread of the sines)^2`. The track is too short, the more the larger the errors of the angles, and averaging does not help ([`crate::robust`] derives and removes this bias). At 77 GHz with two
//! receivers half a wavelength apart, 1 m in 1000 pulses loses 0.2 mm at 30 dB against random errors of 0.6 mm, and 6 mm at 15 dB against 3.5 mm (`tests/increments.rs`; C 7.5.1 has 2 mm).
//!
//! **Units** metres, radians. **Cost** pairs of channels times targets. **Errors** [`MotionError`].

use glam::{DMat2, DVec2};

use crate::arrival::{self, Arrival};
use crate::check::{self, MotionError};
use crate::increment::{Heading, Increment, WRAPPED};
use crate::joint::NoEstimate;
use crate::model::{Array, Sighting};
use std::f64::consts::{PI, TAU};

/// Motion between two pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionEstimate {
    /// Motion from the former to the latter.
    pub increment: Increment,
    /// Number of targets in both pulses.
    pub targets: usize,
    /// Number of phases with ambiguous whole turns.
    pub doubtful: usize,
}

/// Estimator of motion, pulse by pulse.
pub struct Pairwise {
    array: Array,
    heading: Heading,
    before: Vec<(Arrival, usize)>,
    /// Last motion: it predicts the whole turns of the next phases.
    last: Increment,
    pulses: usize,
}

/// Target in two pulses.
struct Pair {
    /// Position in the array's frame half-way.
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

    /// Take the next pulse and return the motion since the pulse before; `None` for the first pulse.
    ///
    /// # Errors
    /// [`MotionError::Sighting`]: the pulse is ignored. [`NoEstimate::Pose`]: the next pulse will be compared with this one.
    pub fn push(&mut self, sightings: &[Sighting]) -> Result<Option<MotionEstimate>, MotionError> {
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
        Ok(Some(MotionEstimate {
            increment,
            targets: pairs.len(),
            doubtful,
        }))
    }

    /// Unwrap a target of both pulses against the last motion; `true` if its whole turns are in doubt.
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

/// The two least squares; `None` if the targets do not determine the motion.
fn solve(array: &Array, pairs: &[Pair], heading: Heading) -> Option<Increment> {
    let channels: Vec<[DVec2; 2]> = array.channels().collect();
    let sums: Vec<DVec2> = channels.iter().map(|[t, r]| *t + *r).collect();
    let count = sums.len() as f64;
    let mean = sums.iter().sum::<DVec2>() / count;
    let k = array.rad_m();
    // Mean of (c, m) over pairs of channels, and the component across their lever arms, which a turn causes.
    let (mut centre, mut across, mut arms) = (DVec2::ZERO, 0.0, 0.0);
    for (i, [t, from_receiver]) in channels.iter().enumerate() {
        for (j, [other, to]) in channels.iter().enumerate() {
            let [transmitter, receiver] = [0.5 * (*t + *other), 0.5 * (*from_receiver + *to)];
            let middle = 0.5 * (transmitter + receiver);
            let (mut matrix, mut right) = (DMat2::ZERO, DVec2::ZERO);
            for pair in pairs {
                let from = |antenna_m: DVec2| (pair.at_m - antenna_m).normalize_or_zero();
                let u = from(middle);
                // Each leg has its own direction.
                let apart = (from(transmitter) - u).dot(*other - *t)
                    + (from(receiver) - u).dot(*to - *from_receiver);
                let shorter = (pair.after[j] - pair.before[i]) / k - apart;
                matrix += DMat2::from_cols(u * u.x, u * u.y) * pair.weight;
                right += u * (shorter * pair.weight);
            }
            // Directions closer than about 0.01 rad do not separate the unknowns.
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
        Heading::Estimated => libm::asin((across / arms).clamp(-1.0, 1.0)),
        Heading::Known => 0.0,
    };
    let (sin, cos) = libm::sincos(half_rad);
    // The turn moves the mean of all channels; the rest is motion of the origin. Then transform from half-way into the former frame.
    let moved_m = DVec2::new(cos, sin).rotate(0.5 * centre - mean.perp() * sin);
    let turn_rad = 2.0 * half_rad;
    (moved_m.is_finite() && turn_rad.is_finite()).then_some(Increment { moved_m, turn_rad })
}
