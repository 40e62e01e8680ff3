//! Displacements of all pulses, places of points and their phases, together, by least squares.
//!
//! ```text
//! arg h_i(n) = c_i + a_i(n) . (x(n) - p_i),    a = k s in the plane, radians a metre
//! ```
//!
//! with a prior of zero and some spread on `x(n)` and `p_i`. For each pulse the two unknowns `x(n)` are eliminated from the normal equations,
//!
//! ```text
//! | X_n  Y_n | | x(n) |   | g_n |         sum_n (Z_n - Y_n^T X_n^-1 Y_n) y = sum_n (h_n - Y_n^T X_n^-1 g_n)
//! | Y_n' Z_n | |  y   | = | h_n |
//! ```
//!
//! so that what is solved has as many unknowns as there are histories and places (`y`), however many pulses there are.
//!
//! Residual phases are followed from pulse to pulse at first, over whole turns: a place that is some resolution cells off turns them by that
//! many. Then they are taken modulo a turn, so that a turn lost in noise does not stay. Those far out of what noise
//! allows count less (Cauchy's weight), so that a bin with two scatterers, or a point that moves, does not pull; the noise is
//! at least what is left of the history's residuals in the middle (their median).

use num_complex::Complex64;

use subaperture_signal::phase::cis;

use super::correction::unwrapped;
use super::dense::solve_definite;

/// A history with how its phase turns with a displacement.
pub(crate) struct Sighted {
    /// Which point it is of.
    pub(crate) point: usize,
    /// A value a turn.
    pub(crate) values: Vec<Complex64>,
    /// Radians a metre along both axes of the plane, a pair a turn.
    pub(crate) slopes: Vec<[f64; 2]>,
    /// Power of all that is not the point.
    pub(crate) rest: f64,
}

/// What is found.
pub(crate) struct Solved {
    /// In the plane, metres, a turn each.
    pub(crate) displacements: Vec<[f64; 2]>,
}

/// Gauss-Newton steps, those first in which phases are followed over whole turns; and the smallest variance of a phase, radians
/// squared: geometry and range cells leave as much.
const ROUNDS: usize = 8;
const FOLLOWED: usize = 4;
const LEAST_VARIANCE: f64 = 1e-4;

/// Residuals, in standard deviations, at which a weight is halved (Cauchy's, 95 % efficient).
const HALVED_AT: f64 = 2.385;

/// Robust passes over the steps of a pulse.
const PASSES: usize = 3;

impl Sighted {
    /// Variance of the phase in turn `n`.
    fn variance(&self, n: usize) -> f64 {
        let power = self.values[n].norm_sqr();
        LEAST_VARIANCE + 0.5 * self.rest / power.max(1e-3 * self.rest)
    }

    fn turn(&self, n: usize, [x, y]: [f64; 2]) -> f64 {
        self.slopes[n][0] * x + self.slopes[n][1] * y
    }
}

fn cauchy(residual: f64, variance: f64) -> f64 {
    1.0 / (1.0 + residual * residual / (variance * HALVED_AT * HALVED_AT))
}

/// Displacements by steps from pulse to pulse, the first at zero; each step with a prior of zero and spread `spread_m`.
pub(crate) fn steps(rows: &[Sighted], turns: usize, spread_m: f64) -> Vec<[f64; 2]> {
    let mut at = [0.0; 2];
    let mut all = vec![at];
    for n in 1..turns {
        let mut step = [0.0; 2];
        for _ in 0..PASSES {
            let prior = 1.0 / (spread_m * spread_m);
            let (mut a, mut b, mut d) = (prior, 0.0, prior);
            let mut right = [0.0; 2];
            for row in rows {
                let [s0, s1] = [0, 1].map(|i| 0.5 * (row.slopes[n - 1][i] + row.slopes[n][i]));
                let turned = row.values[n - 1].conj() * row.values[n];
                // The part of a displacement so far that the line of sight's turning shows.
                let carried = row.turn(n, at) - row.turn(n - 1, at);
                let turned = turned * cis(-carried);
                let phase = libm::atan2(turned.im, turned.re);
                let variance = row.variance(n - 1) + row.variance(n);
                let residual = phase - s0 * step[0] - s1 * step[1];
                let weight = cauchy(residual, variance) / variance;
                a += weight * s0 * s0;
                b += weight * s0 * s1;
                d += weight * s1 * s1;
                right[0] += weight * s0 * phase;
                right[1] += weight * s1 * phase;
            }
            let determinant = a * d - b * b;
            step = [
                (d * right[0] - b * right[1]) / determinant,
                (a * right[1] - b * right[0]) / determinant,
            ];
            if !step.iter().all(|v| v.is_finite()) {
                step = [0.0; 2];
            }
        }
        at = [at[0] + step[0], at[1] + step[1]];
        all.push(at);
    }
    all
}

/// Makes displacements better; `points` are how many, priors those of displacements and of places, metres.
pub(crate) fn refine(
    rows: &[Sighted],
    points: usize,
    [displacement_m, place_m]: [f64; 2],
    solved: &mut Solved,
) {
    let turns = solved.displacements.len();
    let size = rows.len() + 2 * points;
    let mut places = vec![[0.0; 2]; points];
    // Each history's phase, the displacements so far taken away.
    let constant = |row: &Sighted, found: &[[f64; 2]]| {
        let each = row.values.iter().zip(found).enumerate();
        let sum: Complex64 = each.map(|(n, (value, &x))| value * cis(-row.turn(n, x))).sum();
        libm::atan2(sum.im, sum.re)
    };
    let mut constants: Vec<f64> = rows.iter().map(|row| constant(row, &solved.displacements)).collect();
    let prior = 1.0 / (displacement_m * displacement_m);
    for round in 0..ROUNDS {
        let mut matrix = vec![0.0; size * size];
        let mut right = vec![0.0; size];
        for (point, place) in places.iter().enumerate() {
            for (axis, value) in place.iter().enumerate() {
                let i = rows.len() + 2 * point + axis;
                matrix[i * size + i] += 1.0 / (place_m * place_m);
                right[i] -= value / (place_m * place_m);
            }
        }
        // A history's constant has no prior; a little keeps one that says nothing from making the system singular.
        for i in 0..rows.len() {
            matrix[i * size + i] += 1e-6;
        }
        let residuals: Vec<Residuals> = rows
            .iter()
            .zip(&constants)
            .map(|(row, &constant)| {
                Residuals::of(row, constant, places[row.point], &solved.displacements, round < FOLLOWED)
            })
            .collect();
        let mut kept: Vec<Pulse> = Vec::with_capacity(turns);
        for n in 0..turns {
            let pulse = Pulse::of(rows, n, &residuals, solved.displacements[n], prior, size);
            pulse.eliminate(rows, n, &mut matrix, &mut right, size);
            kept.push(pulse);
        }
        let Some(y) = solve_definite(&mut matrix, &right) else {
            return;
        };
        let mut most = 0.0f64;
        for (pulse, x) in kept.iter().zip(&mut solved.displacements) {
            let step = pulse.step(&y);
            most = most.max(libm::hypot(step[0], step[1]));
            *x = [x[0] + step[0], x[1] + step[1]];
        }
        for (constant, step) in constants.iter_mut().zip(&y) {
            *constant += step;
        }
        for (place, step) in places.iter_mut().zip(y[rows.len()..].chunks_exact(2)) {
            *place = [place[0] + step[0], place[1] + step[1]];
        }
        if most < 1e-5 * displacement_m && round > FOLLOWED {
            return;
        }
    }
}

/// What a history's phases are from the best so far, radians.
struct Residuals {
    left_rad: Vec<f64>,
    /// Variance of what is left, by its median.
    variance: f64,
}

impl Residuals {
    fn of(
        row: &Sighted,
        constant: f64,
        place: [f64; 2],
        displacements: &[[f64; 2]],
        followed: bool,
    ) -> Self {
        let each = row.values.iter().zip(displacements).enumerate();
        let wrapped: Vec<f64> = each
            .map(|(n, (value, x))| {
                let model = constant + row.turn(n, [x[0] - place[0], x[1] - place[1]]);
                let left = value * cis(-model);
                libm::atan2(left.im, left.re)
            })
            .collect();
        let mut left_rad = match followed {
            true => unwrapped(&wrapped),
            false => wrapped,
        };
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        // Whole turns of all of it are the constant's.
        let turns = median(&mut left_rad.clone()) / std::f64::consts::TAU;
        left_rad.iter_mut().for_each(|left| *left -= std::f64::consts::TAU * turns.round());
        // The median of a Gaussian's magnitude is 0.6745 of its deviation.
        let deviation = median(&mut left_rad.iter().map(|left| left.abs()).collect()) / 0.6745;
        Self {
            left_rad,
            variance: deviation * deviation,
        }
    }
}

/// The normal equations of a pulse.
struct Pulse {
    /// `X^-1`, symmetric.
    inverse: [f64; 3],
    /// `Y`, two rows.
    mixed: [Vec<f64>; 2],
    /// `g`.
    right: [f64; 2],
    /// Weights and residuals of the histories.
    terms: Vec<[f64; 2]>,
}

impl Pulse {
    fn of(
        rows: &[Sighted],
        n: usize,
        residuals: &[Residuals],
        x: [f64; 2],
        prior: f64,
        size: usize,
    ) -> Self {
        let (mut a, mut b, mut d) = (prior, 0.0, prior);
        let mut right = [-prior * x[0], -prior * x[1]];
        let mut mixed = [vec![0.0; size], vec![0.0; size]];
        let mut terms = Vec::with_capacity(rows.len());
        for (i, (row, residuals)) in rows.iter().zip(residuals).enumerate() {
            let residual = residuals.left_rad[n];
            let variance = row.variance(n).max(residuals.variance);
            let weight = cauchy(residual, variance) / variance;
            let [s0, s1] = row.slopes[n];
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
            terms.push([weight, residual]);
        }
        let determinant = a * d - b * b;
        Self {
            inverse: [d / determinant, -b / determinant, a / determinant],
            mixed,
            right,
            terms,
        }
    }

    fn solve(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [p, q, r] = self.inverse;
        [p * u + q * v, q * u + r * v]
    }

    /// Adds what is left of the pulse once its displacement is eliminated; the matrix's lower triangle.
    fn eliminate(
        &self,
        rows: &[Sighted],
        n: usize,
        matrix: &mut [f64],
        right: &mut [f64],
        size: usize,
    ) {
        for (i, (row, [weight, residual])) in rows.iter().zip(&self.terms).enumerate() {
            let at = rows.len() + 2 * row.point;
            let [s0, s1] = row.slopes[n];
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

    /// The displacement's step once all else is known.
    fn step(&self, y: &[f64]) -> [f64; 2] {
        let along = |mixed: &[f64]| -> f64 { mixed.iter().zip(y).map(|(a, b)| a * b).sum() };
        self.solve([
            self.right[0] - along(&self.mixed[0]),
            self.right[1] - along(&self.mixed[1]),
        ])
    }
}
