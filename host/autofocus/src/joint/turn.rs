//! Normal equations of one turn: elimination of its displacement, and back-substitution.

use glam::DVec3;
use subaperture_signal::phase::cis;

use super::{Sighted, cauchy};
use crate::correction::unwrapped;

/// Residual phases of a history, radians, and their derivatives by displacement.
pub(super) struct Residuals {
    left_rad: Vec<f64>,
    slopes: Vec<[f64; 2]>,
    /// Variance of the residuals, from their median.
    variance: f64,
}

impl Residuals {
    pub(super) fn of(
        row: &Sighted,
        axes: [DVec3; 2],
        constant: f64,
        off_m: DVec3,
        moved_m: impl Iterator<Item = DVec3>,
        followed: bool,
    ) -> Self {
        let (mut wrapped, mut slopes) = (Vec::new(), Vec::new());
        for ((n, value), moved_m) in row.values.iter().enumerate().zip(moved_m) {
            let left = value * cis(-constant - row.model(n, moved_m, off_m));
            wrapped.push(libm::atan2(left.im, left.re));
            slopes.push(row.slopes(n, axes, moved_m, off_m));
        }
        let mut left_rad = match followed {
            true => unwrapped(&wrapped),
            false => wrapped,
        };
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        // Whole turns common to the history belong to its constant.
        let turns = median(&mut left_rad.clone()) / std::f64::consts::TAU;
        left_rad
            .iter_mut()
            .for_each(|left| *left -= std::f64::consts::TAU * turns.round());
        // The median of a Gaussian's magnitude is 0.6745 of its deviation.
        let deviation = median(&mut left_rad.iter().map(|left| left.abs()).collect()) / 0.6745;
        Self {
            left_rad,
            slopes,
            variance: deviation * deviation,
        }
    }

    /// Mean of `2 - 2 cos` of the residual phases.
    pub(super) fn spread(&self) -> f64 {
        let each = self
            .left_rad
            .iter()
            .map(|&left| 2.0 - 2.0 * libm::cos(left));
        each.sum::<f64>() / self.left_rad.len().max(1) as f64
    }
}

/// Normal equations of a turn.
pub(super) struct Turn {
    /// `X^-1`, symmetric: xx, xy, yy.
    inverse: [f64; 3],
    /// Rows of `Y`, one per axis.
    mixed: [Vec<f64>; 2],
    /// Right side `g`, one per axis.
    right: [f64; 2],
    /// Weight, residual and slopes of each history.
    terms: Vec<([f64; 2], [f64; 2])>,
}

impl Turn {
    pub(super) fn of(
        rows: &[Sighted],
        n: usize,
        residuals: &[Residuals],
        from_mean: [f64; 2],
        prior: f64,
        size: usize,
    ) -> Self {
        let (mut a, mut b, mut d) = (prior, 0.0, prior);
        let mut right = [-prior * from_mean[0], -prior * from_mean[1]];
        let mut mixed = [vec![0.0; size], vec![0.0; size]];
        let mut terms = Vec::with_capacity(rows.len());
        for (i, (row, residuals)) in rows.iter().zip(residuals).enumerate() {
            let residual = residuals.left_rad[n];
            let variance = row.variance(n).max(residuals.variance);
            let weight = cauchy(residual, variance) / variance;
            let [s0, s1] = residuals.slopes[n];
            a += weight * s0 * s0;
            b += weight * s0 * s1;
            d += weight * s1 * s1;
            right[0] += weight * s0 * residual;
            right[1] += weight * s1 * residual;
            let at = rows.len() + 2 * row.point;
            for (mixed, slope) in mixed.iter_mut().zip([s0, s1]) {
                mixed[i] += weight * slope;
                mixed[at] -= weight * slope * s0;
                mixed[at + 1] -= weight * slope * s1;
            }
            terms.push(([weight, residual], [s0, s1]));
        }
        let determinant = a * d - b * b;
        Self {
            inverse: [d / determinant, -b / determinant, a / determinant],
            mixed,
            right,
            terms,
        }
    }

    pub(super) fn solve(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [p, q, r] = self.inverse;
        [p * u + q * v, q * u + r * v]
    }

    /// Add the turn's Schur complement (displacement eliminated) to the lower triangle of the matrix.
    pub(super) fn eliminate(
        &self,
        rows: &[Sighted],
        matrix: &mut [f64],
        right: &mut [f64],
        size: usize,
    ) {
        for (i, (row, &([weight, residual], [s0, s1]))) in rows.iter().zip(&self.terms).enumerate()
        {
            let at = rows.len() + 2 * row.point;
            let own = [(i, 1.0), (at, -s0), (at + 1, -s1)];
            for (j, &(to, by)) in own.iter().enumerate() {
                right[to] += weight * by * residual;
                for &(from, other) in &own[..=j] {
                    matrix[to * size + from] += weight * by * other;
                }
            }
        }
        let solved = self.solve(self.right);
        for i in 0..size {
            let [m0, m1] = [self.mixed[0][i], self.mixed[1][i]];
            if m0 == 0.0 && m1 == 0.0 {
                continue;
            }
            right[i] -= m0 * solved[0] + m1 * solved[1];
            let [t0, t1] = self.solve([m0, m1]);
            let line = &mut matrix[i * size..i * size + i + 1];
            for ((to, a), b) in line.iter_mut().zip(&self.mixed[0]).zip(&self.mixed[1]) {
                *to -= t0 * a + t1 * b;
            }
        }
    }

    /// Step of the displacement, given the steps of the other unknowns.
    pub(super) fn step(&self, y: &[f64]) -> [f64; 2] {
        let along = |mixed: &[f64]| -> f64 { mixed.iter().zip(y).map(|(a, b)| a * b).sum() };
        self.solve([
            self.right[0] - along(&self.mixed[0]),
            self.right[1] - along(&self.mixed[1]),
        ])
    }
}
