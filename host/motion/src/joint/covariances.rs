//! How well an estimate is known.

use glam::DMat3;
use subaperture_signal::dense::Factor;

use super::{Estimate, Known, NoEstimate, Normal, Own, block};
use crate::LEAST_PIVOT;
use crate::model::{Array, Sighting};

/// How well an estimate is known.
pub struct Covariances {
    pulses: Vec<Own>,
    /// Targets by targets, row by row.
    targets: Vec<f64>,
    size: usize,
}

/// Covariances about an estimate from pulses of number `first` on: where that is the truth and errors are Gaussian, no unbiased estimator has
/// smaller ones (Cramer and Rao).
///
/// # Errors
/// [`NoEstimate`].
pub fn covariances(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
    estimate: &Estimate,
    known: &Known,
) -> Result<Covariances, NoEstimate> {
    let normal = Normal::new(array, pulses, first, estimate, known, 0.0)?;
    let size = normal.right.len();
    let factor = Factor::new(size, &normal.matrix, LEAST_PIVOT).ok_or(NoEstimate::Targets)?;
    Ok(Covariances {
        pulses: normal.pulses,
        targets: factor.inverse(),
        size,
    })
}

impl Covariances {
    /// Of a pulse's pose: x, y and heading.
    ///
    /// # Panics
    /// If there are not so many pulses.
    pub fn pose(&self, pulse: usize) -> DMat3 {
        let followed = self.by_targets(&[(pulse, DMat3::IDENTITY)]);
        self.alone(pulse) + followed
    }

    /// What a pulse's pose errs by itself, the targets' places being as they are found: independent of other pulses.
    pub(crate) fn alone(&self, pulse: usize) -> DMat3 {
        self.pulses[pulse].inverse
    }

    /// Of a sum of poses' errors, each times a matrix, as far as the targets' errors make them.
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

    /// Of all poses.
    pub fn poses(&self) -> impl Iterator<Item = DMat3> {
        (0..self.pulses.len()).map(|pulse| self.pose(pulse))
    }
}
