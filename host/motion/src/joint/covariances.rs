//! Covariances of a joint estimate.

use glam::{DMat3, DVec2, DVec3};
use subaperture_signal::dense::Factor;

use super::{Estimate, NoEstimate, Normal, Own, Prior, block, outer};
use crate::MIN_PIVOT;
use crate::model::{Array, Pose, Sighting};

/// Joint covariance of poses and targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariances {
    pulses: Vec<Own>,
    /// Covariance of targets by targets, row by row.
    targets: Vec<f64>,
    size: usize,
}

/// Covariance of an estimate from the pulses of number `first` on. It is the Cramer-Rao bound if the estimate is the truth and errors are Gaussian.
///
/// # Errors
/// [`NoEstimate`].
pub fn covariances(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
    estimate: &Estimate,
    prior: &Prior,
) -> Result<Covariances, NoEstimate> {
    let normal = Normal::new(array, pulses, first, estimate, prior, 0.0)?;
    let size = normal.right.len();
    let factor = Factor::new(size, &normal.matrix, MIN_PIVOT).ok_or(NoEstimate::Targets)?;
    Ok(Covariances {
        pulses: normal.pulses,
        targets: factor.inverse(),
        size,
    })
}

/// Alignment of a track with independent positions by one turn and one shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Datum {
    /// All positions, by least squares.
    Shape,
    /// The first position and the first heading.
    First,
}

/// Covariance of a pose of an aligned track: x and y in metres, heading in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlignedCovariance {
    /// Part from noise of single pulses, nearly independent from pulse to pulse.
    pub own: DMat3,
    /// Part from errors of the target positions, common to many pulses.
    pub by_targets: DMat3,
}

impl Covariances {
    /// Covariances of all poses after alignment with the truth by one turn and one shift, in the track's own axes.
    ///
    /// Alignment removes the rigid part of the errors `e = (x, y, heading)`:
    ///
    /// ```text
    /// e_n - P sum_m w_m e_m - b_n sum_m c_m . e_m,    b_n = (perp(p_n - p), 1),   p = sum_m w_m p_m,   P = diag(1, 1, 0)
    /// Shape   w_m = 1 / N,          c_m = (perp(p_m - p), 0) / sum_k |p_k - p|^2
    /// First   w_m = 1 for m = 0,    c_0 = (0, 0, 1)
    /// ```
    ///
    /// so that the result does not depend on the gauge of the least squares. A track that stays in one place has no turn: `Shape` then omits it.
    ///
    /// # Panics
    /// If there are not as many poses as pulses.
    pub fn aligned(&self, poses: &[Pose], datum: Datum) -> Vec<AlignedCovariance> {
        assert_eq!(poses.len(), self.pulses.len());
        let targets = self.size / 3;
        let share = 1.0 / poses.len().max(1) as f64;
        let weight = |n: usize| match datum {
            Datum::Shape => share,
            Datum::First => f64::from(u8::from(n == 0)),
        };
        let each = || poses.iter().enumerate();
        let middle_m: DVec2 = each().map(|(n, pose)| weight(n) * pose.at_m).sum();
        let arm = |pose: &Pose| (pose.at_m - middle_m).perp();
        let size: f64 = poses.iter().map(|pose| arm(pose).length_squared()).sum();
        let turn = |n: usize, pose: &Pose| match datum {
            Datum::Shape if size > 0.0 => (arm(pose) / size).extend(0.0),
            Datum::First if n == 0 => DVec3::Z,
            _ => DVec3::ZERO,
        };
        let plane = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0));
        // Parts of shift and turn by single pulses, and by targets.
        let (mut shift, mut both, mut turns) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        let mut shift_by = vec![DMat3::ZERO; targets];
        let mut turn_by = vec![DVec3::ZERO; targets];
        for (n, pose) in each() {
            let (w, c, own) = (weight(n), turn(n, pose), &self.pulses[n]);
            let by_turn = own.inverse * c;
            shift += own.inverse * (w * w);
            both += by_turn * w;
            turns += c.dot(by_turn);
            for (target, with) in &own.with {
                let follows = own.inverse * *with;
                shift_by[*target] += follows * w;
                turn_by[*target] += follows.transpose() * c;
            }
        }
        let (shift, both) = (plane * shift * plane, plane * both);
        let pose = |(n, pose): (usize, &Pose)| {
            let (w, c, own) = (weight(n), turn(n, pose), &self.pulses[n]);
            let b = arm(pose).extend(match c == DVec3::ZERO && size == 0.0 {
                true => 0.0,
                false => 1.0,
            });
            let itself = plane * w + outer(b, c);
            let taken = itself * own.inverse;
            let alone = own.inverse - taken - taken.transpose()
                + shift
                + outer(both, b)
                + outer(b, both)
                + outer(b, b) * turns;
            let mut follows: Vec<DMat3> = shift_by
                .iter()
                .zip(&turn_by)
                .map(|(shift, turn)| -(plane * *shift) - outer(b, *turn))
                .collect();
            for (target, with) in &own.with {
                follows[*target] += own.inverse * *with;
            }
            AlignedCovariance {
                own: alone,
                by_targets: self.through(&follows),
            }
        };
        each().map(pose).collect()
    }

    /// `F T F'`, with a block of `F` a target and the covariance `T` of the targets.
    fn through(&self, follows: &[DMat3]) -> DMat3 {
        let mut covariance = DMat3::ZERO;
        for (a, of_a) in follows.iter().enumerate() {
            let mut row = DMat3::ZERO;
            for (b, of_b) in follows.iter().enumerate() {
                row += block(&self.targets, self.size, [a, b]) * of_b.transpose();
            }
            covariance += *of_a * row;
        }
        covariance
    }

    /// Covariance of a pulse's pose: x, y in metres and heading in radians.
    ///
    /// # Panics
    /// If there is no such pulse.
    pub fn pose(&self, pulse: usize) -> DMat3 {
        let followed = self.by_targets(&[(pulse, DMat3::IDENTITY)]);
        self.alone(pulse) + followed
    }

    /// Covariance of a pose for known targets: independent of other pulses.
    pub(crate) fn alone(&self, pulse: usize) -> DMat3 {
        self.pulses[pulse].inverse
    }

    /// Covariance by target errors of a sum of pose errors, each times a matrix.
    pub(crate) fn by_targets(&self, poses: &[(usize, DMat3)]) -> DMat3 {
        let mut follows: Vec<(usize, DMat3)> = Vec::new();
        for (pulse, turned) in poses {
            let own = &self.pulses[*pulse];
            for (target, both) in &own.with {
                let part = *turned * own.inverse * *both;
                match follows.iter_mut().find(|(other, _)| other == target) {
                    Some((_, sum)) => *sum += part,
                    None => follows.push((*target, part)),
                }
            }
        }
        let mut covariance = DMat3::ZERO;
        for (a, of_a) in &follows {
            for (b, of_b) in &follows {
                let both = block(&self.targets, self.size, [*a, *b]);
                covariance += *of_a * both * of_b.transpose();
            }
        }
        covariance
    }

    /// Covariances of all poses.
    pub fn poses(&self) -> impl Iterator<Item = DMat3> {
        (0..self.pulses.len()).map(|pulse| self.pose(pulse))
    }
}
