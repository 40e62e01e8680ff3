//! Composition of successive increments.
//!
//! Up to increment k the body has moved by `(x, y)_k` in the axes that it had at first, and turned by `psi_k`:
//!
//! ```text
//! (x, y)_(k+1) = (x, y)_k + R(psi_k) (dx (1 - s), dy),      psi_(k+1) = psi_k + dpsi
//! ```
//!
//! with `s` the scale error of the radar's x. The result does not depend on the initial pose and is computed once. `F = d(k+1)/d(k)` has in the column of `psi` the effect of a turn on the step, and covariances follow as
//! `C_(k+1) = F C_k F' + G Q G'`, `G = (R(psi_k), 1)`. From k to a later n the same column is `(-(y_n - y_k), x_n - x_k)`.

use super::Increment;
use subaperture_signal::dense::fixed::{Matrix, plus, times, transposed, zero};

/// Motion since the first increment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bundle {
    /// x, y, turn: metres and radians.
    pub(super) moved: [f64; 3],
    /// Derivatives of x and y by the scale error.
    pub(super) by_scale: [f64; 2],
    pub(super) covariance: Matrix<3, 3>,
}

impl Bundle {
    /// No motion.
    pub(super) fn new() -> Self {
        Self {
            moved: [0.0; 3],
            by_scale: [0.0; 2],
            covariance: zero(),
        }
    }

    /// Append an increment.
    pub(super) fn push(&mut self, one: &Increment) {
        let (sin, cos) = libm::sincos(self.moved[2]);
        let [dx, dy] = one.moved_m;
        let step = [cos * dx - sin * dy, sin * dx + cos * dy];
        let along = turn_of([-step[1], step[0]]);
        let into = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        // The matrix is symmetric: columns are rows.
        let noise = one.covariance.to_cols_array_2d();
        let carried = times(&times(&along, &self.covariance), &transposed(&along));
        let added = times(&times(&into, &noise), &transposed(&into));
        self.covariance = plus(&carried, &added);
        self.by_scale[0] -= cos * dx;
        self.by_scale[1] -= sin * dx;
        self.moved[0] += step[0];
        self.moved[1] += step[1];
        self.moved[2] += one.turned_rad;
    }

    /// Compose all increments.
    pub(super) fn of(increments: &[Increment]) -> Self {
        let mut bundle = Self::new();
        increments.iter().for_each(|one| bundle.push(one));
        bundle
    }

    /// Transition matrix of errors to a later time.
    pub(super) fn onward(&self, later: &Self) -> Matrix<3, 3> {
        turn_of([
            self.moved[1] - later.moved[1],
            later.moved[0] - self.moved[0],
        ])
    }
}

/// Identity with the effect of a turn.
pub(super) fn turn_of(moved: [f64; 2]) -> Matrix<3, 3> {
    [[1.0, 0.0, moved[0]], [0.0, 1.0, moved[1]], [0.0, 0.0, 1.0]]
}
