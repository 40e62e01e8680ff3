//! Least squares of poses and targets together.
//!
//! ```text
//! sum over pulses n, their targets i and measured numbers c:  rho((measured - model_c(pose_n, target_i)) / sigma)^2
//! ```
//!
//! by Levenberg-Marquardt steps. `rho` is Huber's function: residuals beyond [`HUBER`] standard deviations count linearly. No measurement depends on two poses: the normal equations are an arrowhead (bordered
//! block-diagonal) system, in which poses are eliminated one by one (Schur complement). What remains is a system of the targets: time grows with the number of pulses, and with the cube of the targets. A pulse that
//! leaves the window is marginalised into a prior of the targets ([`Prior`]), linearised at its last estimate.
//!
//! **Gauge.** Measurements determine neither the first position nor the orientation of the whole. The first position is held, and the direction from it to the first target; the first heading is estimated like the
//! others. (With the first heading held instead, an error of its directions of arrival would turn the whole track along an arc that linear steps cannot follow.) Known headings ([`Heading::Known`]) are those of the frame
//! and stay as given; then only the first position is held, as directions of arrival determine the orientation.
//!
//! Phases must be unwrapped: see [`crate::tracker`].

mod covariances;
mod prior;

use glam::{DMat3, DVec3};
use subaperture_signal::dense::Factor;

use crate::MIN_PIVOT;
use crate::increment::Heading;
use crate::model::{Array, Line, Pose, Sighting, Target};

pub use covariances::{AlignedCovariance, Covariances, Datum, covariances};
pub use prior::Prior;

/// Residual in standard deviations beyond which it is taken for an outlier.
pub const HUBER: f64 = 4.0;

/// Largest number of steps.
const MAX_STEPS: usize = 100;
/// Predicted decrease of the sum of squares below which the iteration ends: no unknown moves by more than 1/300 of its standard deviation.
const MIN_DECREASE: f64 = 1e-5;
/// Relative damping of the diagonal: negligible where steps do not overshoot, and largest.
const DAMPING: f64 = 1e-9;
const MAX_DAMPING: f64 = 1e8;

/// Information of a held coordinate, 1/m^2: a standard deviation of a micrometre.
const HELD: f64 = 1e12;

/// Estimate of all poses and targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Pose of each pulse.
    pub poses: Vec<Pose>,
    /// Targets, indexed by their number.
    pub targets: Vec<Target>,
    /// Whether headings are estimated, or known and kept.
    pub heading: Heading,
}

/// Reason why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoEstimate {
    /// A pulse does not determine its pose.
    #[error(
        "pulse {0} has too few targets for a pose: expected at least two in different directions"
    )]
    Pose(usize),
    /// Sightings do not determine the targets.
    #[error(
        "the sightings do not determine the positions of the targets: targets in different directions, or more motion, are needed"
    )]
    Targets,
    /// A step is not finite.
    #[error(
        "the least squares diverge: measured values exceed the range of floating-point numbers"
    )]
    Diverged,
}

/// Result of the least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// Sum of squared residuals of these pulses, in standard deviations.
    pub sum: f64,
    /// Whether the iteration converged. It fails to if few targets are seen, targets are confused, or phases are off by whole turns.
    pub converged: bool,
}

/// Contribution of a pulse to the normal equations.
#[derive(Clone, Debug, PartialEq)]
struct Own {
    /// Inverse of the pose's block.
    inverse: DMat3,
    right: DVec3,
    /// Blocks of pose by target.
    with: Vec<(usize, DMat3)>,
}

/// Normal equations at an estimate.
struct Normal {
    pulses: Vec<Own>,
    /// Targets by targets after elimination of the poses, row by row.
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// Sum of squared residuals of these pulses.
    sum: f64,
    /// Squared residual of the prior, up to a constant.
    prior_cost: f64,
    /// Relative damping of the diagonal.
    damping: f64,
}

/// Add a block of target by target.
fn add(matrix: &mut [f64], size: usize, [row, column]: [usize; 2], block: DMat3) {
    for (j, values) in block.to_cols_array_2d().into_iter().enumerate() {
        for (i, value) in values.into_iter().enumerate() {
            matrix[(3 * row + i) * size + 3 * column + j] += value;
        }
    }
}

/// Block of target by target.
fn block(matrix: &[f64], size: usize, [row, column]: [usize; 2]) -> DMat3 {
    let at = |i: usize, j: usize| matrix[(3 * row + i) * size + 3 * column + j];
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|j| [0, 1, 2].map(|i| at(i, j))))
}

/// Outer product `a b^T`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Huber weight of a residual in standard deviations, and its cost.
fn huber(error: f64) -> (f64, f64) {
    let size = error.abs();
    match size <= HUBER {
        true => (1.0, size * size),
        false => (HUBER / size, HUBER * (2.0 * size - HUBER)),
    }
}

/// Measurements of a sighting with their standard deviations and model values.
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
    /// Empty equations of this size.
    fn empty(size: usize, damping: f64) -> Self {
        Self {
            pulses: Vec::new(),
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
            sum: 0.0,
            prior_cost: 0.0,
            damping,
        }
    }

    /// Equations of the pulses from number `first` on.
    fn new(
        array: &Array,
        pulses: &[Vec<Sighting>],
        first: usize,
        estimate: &Estimate,
        prior: &Prior,
        damping: f64,
    ) -> Result<Self, NoEstimate> {
        let size = 3 * estimate.targets.len();
        let mut normal = Self::empty(size, damping);
        normal.add_prior(prior, &estimate.targets);
        if let (Some(target), Heading::Estimated) = (estimate.targets.first(), estimate.heading) {
            // Across the direction from the first pose, which is the origin.
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

    fn add_prior(&mut self, prior: &Prior, targets: &[Target]) {
        let size = self.right.len();
        let before = prior.vector.len();
        let at: Vec<f64> = targets.iter().flat_map(values).collect();
        for (i, row) in prior.information.chunks_exact(before.max(1)).enumerate() {
            let mut pull = prior.vector[i];
            for (j, value) in row.iter().enumerate() {
                self.matrix[i * size + j] += value;
                pull -= value * at[j];
            }
            self.matrix[i * size + i] += self.damping * row[i];
            self.right[i] += pull;
            self.prior_cost -= at[i] * (prior.vector[i] + pull);
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
        if heading == Heading::Known {
            enlarged.z += HELD;
            // A known heading is not corrected.
            own_right.z = 0.0;
        }
        own += DMat3::from_diagonal(enlarged);
        // Symmetric, so that rows are columns.
        let factor =
            Factor::new(3, &own.to_cols_array(), MIN_PIVOT).ok_or(NoEstimate::Pose(number))?;
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
    /// Estimate after a step from `at`, and the decrease of the sum of squares predicted by the linear model.
    fn step(&self, at: &Estimate) -> Result<(Estimate, f64), NoEstimate> {
        let factor =
            Factor::new(self.right.len(), &self.matrix, MIN_PIVOT).ok_or(NoEstimate::Targets)?;
        let mut step = self.right.clone();
        factor.solve(&mut step);
        let mut predicted: f64 = step.iter().zip(&self.right).map(|(a, b)| a * b).sum();
        let mut next = at.clone();
        for (target, step) in next.targets.iter_mut().zip(step.chunks_exact(3)) {
            target.at_m.x += step[0];
            target.at_m.y += step[1];
            target.phase_rad += step[2];
        }
        for (pose, own) in next.poses.iter_mut().zip(&self.pulses) {
            // The part of the poses alone; the targets' part is in their step.
            predicted += own.right.dot(own.inverse * own.right);
            let follow = own
                .with
                .iter()
                .map(|(target, both)| *both * DVec3::from_slice(&step[3 * target..3 * target + 3]));
            let moved = own.inverse * (own.right - follow.sum::<DVec3>());
            pose.at_m += moved.truncate();
            if at.heading == Heading::Estimated {
                pose.heading_rad += moved.z;
            }
        }
        match predicted.is_finite() {
            true => Ok((next, predicted)),
            false => Err(NoEstimate::Diverged),
        }
    }
}

fn values(target: &Target) -> [f64; 3] {
    [target.at_m.x, target.at_m.y, target.phase_rad]
}

/// Minimise the sum of squares over the pulses from number `first` on, starting from `estimate`.
///
/// # Errors
/// [`NoEstimate`].
///
/// # Panics
/// If there are not as many poses as pulses, or a sighting has an unknown target or not one phase a channel.
pub fn solve(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
    estimate: &mut Estimate,
    prior: &Prior,
) -> Result<Solved, NoEstimate> {
    assert_eq!(pulses.len(), estimate.poses.len());
    let mut damping = DAMPING;
    let normal = |at: &Estimate, damping| Normal::new(array, pulses, first, at, prior, damping);
    let mut now = normal(estimate, damping)?;
    let mut converged = false;
    for _ in 0..MAX_STEPS {
        let (next, predicted) = now.step(estimate)?;
        converged = predicted < MIN_DECREASE;
        let then = normal(&next, damping)?;
        // Large numbers nearly cancel: their rounding is no increase.
        let rounding = 1e-13 * now.prior_cost.abs();
        if then.sum + then.prior_cost <= now.sum + now.prior_cost + rounding {
            (*estimate, now) = (next, then);
            if damping == DAMPING {
                match converged {
                    true => break,
                    false => continue,
                }
            }
            damping = (damping / 100.0).max(DAMPING);
        } else if !converged {
            damping *= 10.0;
        }
        // Neither converged nor decreasing: give up.
        if converged || damping > MAX_DAMPING {
            break;
        }
        now = normal(estimate, damping)?;
    }
    Ok(Solved {
        sum: now.sum,
        converged,
    })
}
