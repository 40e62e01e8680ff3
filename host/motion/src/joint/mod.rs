//! Poses and targets together, by least squares.
//!
//! ```text
//! sum over pulses n, their targets i and measured numbers c:  rho((measured - model_c(pose_n, target_i)) / sigma)^2
//! ```
//!
//! by Levenberg and Marquardt's steps, `rho` Huber's: what is off by more than [`HUBER`] standard deviations counts by its distance alone. No measured number
//! knows two poses, so that poses are eliminated one by one (the Schur complement), and what is left is a system of all targets: time
//! grows with the pulses, and with the cube of the targets. A pulse that will not be looked at again becomes part of what is
//! known of the targets ([`Known`]), about where it was last looked at.
//!
//! **What is held.** Nothing that is measured tells where the first pose lies, nor how everything together is turned about it. So the first
//! pose's place is held, and the direction from it to the first target; the first heading is found as the others are. (With the first heading held instead,
//! an error of its angles of arrival would turn the whole track, on an arc that straight steps cannot follow.) Where headings are known ([`Heading::Held`]) they
//! are those of the frame, stay as the estimate has them, and nothing else is held but the first place: angles of arrival tell directions.
//!
//! Phases must be without wraps: [`crate::tracker`] takes care of that.

mod covariances;
mod known;

use glam::{DMat3, DVec3};
use subaperture_signal::dense::Factor;

use crate::LEAST_PIVOT;
use crate::increment::Heading;
use crate::model::{Array, Line, Pose, Sighting, Target};

pub use covariances::{Covariances, covariances};
pub use known::Known;

/// Standard deviations up to which errors are taken for Gaussian.
pub const HUBER: f64 = 4.0;

/// Steps at most.
const MOST_STEPS: usize = 100;
/// A step that promises less of the sum of squares is the last: it moves nothing by more than a three-hundredth of its standard deviation.
const ENOUGH: f64 = 1e-5;
/// How much diagonals are enlarged: nothing to speak of where steps do not overshoot, and at most.
const DAMPING: f64 = 1e-9;
const MOST_DAMPING: f64 = 1e8;

/// Information of what is held: a micrometre.
const HELD: f64 = 1e12;

/// Where everything is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// One a pulse.
    pub poses: Vec<Pose>,
    /// Of all that is seen, by number.
    pub targets: Vec<Target>,
    /// Whether headings are found, or known and stay as the poses have them.
    pub heading: Heading,
}

/// Why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoEstimate {
    /// A pulse does not tell its pose.
    #[error(
        "pulse {0} sees too little to tell where it was: two targets in different directions, or more, are needed"
    )]
    Pose(usize),
    /// The places of targets do not follow.
    #[error("what is seen does not tell where the targets are")]
    Targets,
    /// A step leads nowhere.
    #[error("the least squares lead nowhere: what is measured is beyond what can be computed with")]
    Nowhere,
}

/// How far the least squares came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// The sum of squares, in standard deviations, of these pulses.
    pub sum: f64,
    /// Whether further steps would change nothing: not so where little is seen as yet, or targets are confused, or phases wrapped.
    pub settled: bool,
}

/// A pulse's part of the normal equations.
struct Own {
    /// Of its pose's matrix.
    inverse: DMat3,
    right: DVec3,
    /// Pose by target.
    with: Vec<(usize, DMat3)>,
}

/// The normal equations about an estimate.
struct Normal {
    pulses: Vec<Own>,
    /// Targets by targets, poses eliminated, row by row.
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// The sum of squares of these pulses.
    sum: f64,
    /// By how much targets displease what is known, but for a constant.
    displeased: f64,
    /// How much diagonals are enlarged.
    damping: f64,
}

/// Adds a block of a target by a target.
fn add(matrix: &mut [f64], size: usize, [row, column]: [usize; 2], block: DMat3) {
    for (j, values) in block.to_cols_array_2d().into_iter().enumerate() {
        for (i, value) in values.into_iter().enumerate() {
            matrix[(3 * row + i) * size + 3 * column + j] += value;
        }
    }
}

/// A block of a target by a target.
fn block(matrix: &[f64], size: usize, [row, column]: [usize; 2]) -> DMat3 {
    let at = |i: usize, j: usize| matrix[(3 * row + i) * size + 3 * column + j];
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|j| [0, 1, 2].map(|i| at(i, j))))
}

/// `a b^T`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Weight of an error of so many standard deviations, and its square as it counts.
fn huber(error: f64) -> (f64, f64) {
    let size = error.abs();
    match size <= HUBER {
        true => (1.0, size * size),
        false => (HUBER / size, HUBER * (2.0 * size - HUBER)),
    }
}

/// The numbers of a sighting with their standard deviations, as the model has them.
fn measured<'a>(
    array: &Array,
    pose: &Pose,
    targets: &[Target],
    sighting: &'a Sighting,
) -> impl Iterator<Item = (f64, f64, Line)> + 'a {
    let lines = array.lines(pose, &targets[sighting.target]);
    let phases = sighting
        .phases_rad
        .iter()
        .map(|&phase| (phase, sighting.phase_sigma_rad));
    let range = (sighting.range_m, sighting.range_sigma_m);
    phases
        .chain(std::iter::once(range))
        .zip(lines)
        .map(|((value, sigma), line)| (value, sigma, line))
}

impl Normal {
    /// Of nothing yet, for systems of this size.
    fn empty(size: usize, damping: f64) -> Self {
        Self {
            pulses: Vec::new(),
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
            sum: 0.0,
            displeased: 0.0,
            damping,
        }
    }

    /// Of pulses from number `first` on.
    fn new(
        array: &Array,
        pulses: &[Vec<Sighting>],
        first: usize,
        estimate: &Estimate,
        known: &Known,
        damping: f64,
    ) -> Result<Self, NoEstimate> {
        let size = 3 * estimate.targets.len();
        let mut normal = Self::empty(size, damping);
        normal.add_known(known, &estimate.targets);
        if let (Some(target), Heading::Found) = (estimate.targets.first(), estimate.heading) {
            // Across the direction in which it is seen from the first pose, which is the origin.
            let across = target.at_m.perp().normalize_or_zero().extend(0.0);
            add(
                &mut normal.matrix,
                size,
                [0; 2],
                outer(across * HELD, across),
            );
        }
        for (n, (sightings, pose)) in pulses.iter().zip(&estimate.poses).enumerate() {
            let own = (pose, estimate.heading);
            normal.add_pulse(array, sightings, first + n, own, &estimate.targets)?;
        }
        Ok(normal)
    }

    fn add_known(&mut self, known: &Known, targets: &[Target]) {
        let size = self.right.len();
        let before = known.vector.len();
        let at: Vec<f64> = targets.iter().flat_map(values).collect();
        for (i, row) in known.information.chunks_exact(before.max(1)).enumerate() {
            let mut pull = known.vector[i];
            for (j, value) in row.iter().enumerate() {
                self.matrix[i * size + j] += value;
                pull -= value * at[j];
            }
            self.matrix[i * size + i] += self.damping * row[i];
            self.right[i] += pull;
            self.displeased -= at[i] * (known.vector[i] + pull);
        }
    }

    fn add_pulse(
        &mut self,
        array: &Array,
        sightings: &[Sighting],
        number: usize,
        (pose, heading): (&Pose, Heading),
        targets: &[Target],
    ) -> Result<(), NoEstimate> {
        let size = self.right.len();
        if number > 0 && sightings.len() < 2 {
            return Err(NoEstimate::Pose(number));
        }
        let mut own = DMat3::ZERO;
        let mut own_right = DVec3::ZERO;
        let mut with = Vec::with_capacity(sightings.len());
        for sighting in sightings {
            let (mut of_target, mut both) = (DMat3::ZERO, DMat3::ZERO);
            let mut right = DVec3::ZERO;
            for (value, sigma, line) in measured(array, pose, targets, sighting) {
                let error = (value - line.value) / sigma;
                let (part, square) = huber(error);
                let weight = part / (sigma * sigma);
                self.sum += square;
                own += outer(line.pose * weight, line.pose);
                of_target += outer(line.target * weight, line.target);
                both += outer(line.pose * weight, line.target);
                own_right += line.pose * (weight * sigma * error);
                right += line.target * (weight * sigma * error);
            }
            let target = sighting.target;
            let enlarged = of_target + DMat3::from_diagonal(diagonal(of_target) * self.damping);
            add(&mut self.matrix, size, [target; 2], enlarged);
            let to = self.right[3 * target..].iter_mut();
            to.zip(right.to_array())
                .for_each(|(to, value)| *to += value);
            with.push((target, both));
        }
        let mut enlarged = diagonal(own) * self.damping;
        if number == 0 {
            enlarged += DVec3::new(HELD, HELD, 0.0);
        }
        if heading == Heading::Held {
            enlarged.z += HELD;
            // Nothing pulls at what is known.
            own_right.z = 0.0;
        }
        own += DMat3::from_diagonal(enlarged);
        // Symmetric, so that rows are columns.
        let factor =
            Factor::new(3, &own.to_cols_array(), LEAST_PIVOT).ok_or(NoEstimate::Pose(number))?;
        let inverse = DMat3::from_cols_slice(&factor.inverse());
        let pose_alone = inverse * own_right;
        for (target, both) in &with {
            let taken = both.transpose() * pose_alone;
            let to = self.right[3 * target..].iter_mut();
            to.zip(taken.to_array())
                .for_each(|(to, value)| *to -= value);
            let follows = inverse * *both;
            for (other, before) in &with {
                let taken = before.transpose() * follows;
                add(&mut self.matrix, size, [*other, *target], -taken);
            }
        }
        self.pulses.push(Own {
            inverse,
            right: own_right,
            with,
        });
        Ok(())
    }
}

fn diagonal(matrix: DMat3) -> DVec3 {
    DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z)
}

impl Normal {
    /// The estimate after a step from `at`, and how much of the sum of squares that promises to take.
    fn step(&self, at: &Estimate) -> Result<(Estimate, f64), NoEstimate> {
        let factor =
            Factor::new(self.right.len(), &self.matrix, LEAST_PIVOT).ok_or(NoEstimate::Targets)?;
        let mut step = self.right.clone();
        factor.solve(&mut step);
        let mut promised: f64 = step.iter().zip(&self.right).map(|(a, b)| a * b).sum();
        let mut next = at.clone();
        for (target, step) in next.targets.iter_mut().zip(step.chunks_exact(3)) {
            target.at_m.x += step[0];
            target.at_m.y += step[1];
            target.phase_rad += step[2];
        }
        for (pose, own) in next.poses.iter_mut().zip(&self.pulses) {
            // What elimination left to targets is in their step.
            promised += own.right.dot(own.inverse * own.right);
            let follow = own
                .with
                .iter()
                .map(|(target, both)| *both * DVec3::from_slice(&step[3 * target..3 * target + 3]));
            let moved = own.inverse * (own.right - follow.sum::<DVec3>());
            pose.at_m += moved.truncate();
            if at.heading == Heading::Found {
                pose.heading_rad += moved.z;
            }
        }
        match promised.is_finite() {
            true => Ok((next, promised)),
            false => Err(NoEstimate::Nowhere),
        }
    }
}

fn values(target: &Target) -> [f64; 3] {
    [target.at_m.x, target.at_m.y, target.phase_rad]
}

/// Brings an estimate to the least sum of squares, of pulses from number `first` on.
///
/// # Errors
/// [`NoEstimate`].
///
/// # Panics
/// If there are not as many poses as pulses, or a sighting is of no target or not of all channels.
pub fn solve(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
    estimate: &mut Estimate,
    known: &Known,
) -> Result<Solved, NoEstimate> {
    assert_eq!(pulses.len(), estimate.poses.len());
    let mut damping = DAMPING;
    let normal = |at: &Estimate, damping| Normal::new(array, pulses, first, at, known, damping);
    let mut now = normal(estimate, damping)?;
    let mut settled = false;
    for _ in 0..MOST_STEPS {
        let (next, promised) = now.step(estimate)?;
        settled = promised < ENOUGH;
        let then = normal(&next, damping)?;
        // Of large numbers that nearly cancel, their rounding is no increase.
        let rounding = 1e-13 * now.displeased.abs();
        if then.sum + then.displeased <= now.sum + now.displeased + rounding {
            (*estimate, now) = (next, then);
            if damping == DAMPING {
                match settled {
                    true => break,
                    false => continue,
                }
            }
            damping = (damping / 100.0).max(DAMPING);
        } else if !settled {
            damping *= 10.0;
        }
        // What is not settled and cannot be made smaller will not be.
        if settled || damping > MOST_DAMPING {
            break;
        }
        now = normal(estimate, damping)?;
    }
    Ok(Solved {
        sum: now.sum,
        settled,
    })
}
