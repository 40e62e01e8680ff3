//! Prior from pulses outside the window (marginalised normal equations).

use glam::{DMat3, DVec3};
use subaperture_signal::dense::Factor;

use super::{DAMPING, NoEstimate, Normal, block, diagonal, values};
use crate::MIN_PIVOT;
use crate::increment::Heading;
use crate::model::{Array, Pose, Sighting, Target};

/// Prior of the targets from pulses outside the window: marginalised normal equations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prior {
    /// Information matrix, row by row, three numbers a target.
    pub(super) information: Vec<f64>,
    /// Information matrix times the targets that minimise the prior's cost.
    pub(super) vector: Vec<f64>,
}

impl Prior {
    /// Add a pulse that leaves the window, with its pose and whether its heading is known.
    ///
    /// # Errors
    /// [`NoEstimate::Pose`].
    pub fn take(
        &mut self,
        array: &Array,
        sightings: &[Sighting],
        number: usize,
        pose: (&Pose, Heading),
        targets: &[Target],
    ) -> Result<(), NoEstimate> {
        self.grow(targets.len());
        let size = 3 * targets.len();
        let mut own = Normal::empty(size, 0.0);
        own.add_pulse(array, sightings, number, pose, targets)?;
        let at: Vec<f64> = targets.iter().flat_map(values).collect();
        for i in 0..size {
            let row = &own.matrix[i * size..(i + 1) * size];
            self.vector[i] += own.right[i] + row.iter().zip(&at).map(|(a, b)| a * b).sum::<f64>();
        }
        let both = self.information.iter_mut().zip(own.matrix);
        both.for_each(|(to, value)| *to += value);
        Ok(())
    }

    /// Marginalise a target out.
    pub(crate) fn forget(&mut self, target: usize) {
        let size = self.vector.len();
        if 3 * target >= size {
            return;
        }
        let own = block(&self.information, size, [target; 2]);
        // Damped: pulses may determine a target in one direction only.
        let own = own + DMat3::from_diagonal(diagonal(own) * DAMPING);
        let rest: Vec<usize> = (0..size).filter(|i| i / 3 != target).collect();
        let at = |i: usize, j: usize| self.information[i * size + j];
        let with = |i: usize| DVec3::from_array([0, 1, 2].map(|k| at(i, 3 * target + k)));
        // Without a factor the target carries no information.
        let inverse = Factor::new(3, &own.to_cols_array(), MIN_PIVOT)
            .map_or(DMat3::ZERO, |factor| {
                DMat3::from_cols_slice(&factor.inverse())
            });
        let minimum = DVec3::from_slice(&self.vector[3 * target..3 * target + 3]);
        let each = rest.iter();
        let information = each.clone().flat_map(|&i| {
            let through = inverse * with(i);
            rest.iter().map(move |&j| at(i, j) - through.dot(with(j)))
        });
        let vector = each.map(|&i| self.vector[i] - (inverse * with(i)).dot(minimum));
        (self.information, self.vector) = (information.collect(), vector.collect());
    }

    /// Resize to this many targets.
    fn grow(&mut self, targets: usize) {
        let (before, after) = (self.vector.len(), 3 * targets);
        if before == after {
            return;
        }
        let mut information = vec![0.0; after * after];
        for (i, row) in self.information.chunks_exact(before.max(1)).enumerate() {
            information[i * after..i * after + before].copy_from_slice(row);
        }
        self.information = information;
        self.vector.resize(after, 0.0);
    }
}
