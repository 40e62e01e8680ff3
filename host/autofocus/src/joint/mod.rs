//! Joint least-squares estimation of antenna displacements, point positions and point phases in exact geometry.
//!
//! The measurement is the phase of a history, compensated to an assumed position `q_i` by the recorded antennas. Its model, for a point at
//! `q_i + p_i` and antennas displaced by `x(n)`, is
//!
//! ```text
//! arg h_i(n) = c_i - k (path(q_i + p_i, antennas + x(n)) - path(q_i, antennas))
//! ```
//!
//! with the derivatives `k s` by `x` and `-k s` by `p`, `s = u_t + u_r`, recomputed in every Gauss-Newton step. `x(n)` and `p_i` have Gaussian
//! priors, of zero mean unless another mean of `x(n)` is given. For each pulse the two unknowns `x(n)` are eliminated from the normal equations,
//!
//! ```text
//! | X_n  Y_n | | x(n) |   | g_n |         sum_n (Z_n - Y_n^T X_n^-1 Y_n) y = sum_n (h_n - Y_n^T X_n^-1 g_n)
//! | Y_n' Z_n | |  y   | = | h_n |
//! ```
//!
//! so that the remaining unknowns are those of the histories and positions (`y`), for any number of pulses.
//!
//! Residual phases are first unwrapped from pulse to pulse, as a position error of some resolution cells rotates them by as many turns. Later
//! they are wrapped, so that a turn lost in noise does not persist. Outliers have less weight (Cauchy's function), such as a bin with two scatterers
//! or a moving point; the noise is at least the median of the history's residuals.

mod sighted;
mod turn;

use glam::DVec3;
use num_complex::Complex64;

use subaperture_model::resolution::support::path_gradient;
use subaperture_signal::dense::Factor;
use subaperture_signal::phase::cis;

use sighted::cauchy;
use turn::{Residuals, Turn};

pub(crate) use sighted::Sighted;

/// Estimate of the displacements.
#[derive(Clone)]
pub(crate) struct Solved {
    /// Components in the plane, metres, one entry per turn.
    pub(crate) displacements: Vec<[f64; 2]>,
    /// Mean of the prior on the displacements, metres, one entry per turn; zero if empty.
    pub(crate) expected: Vec<[f64; 2]>,
}

/// Gauss-Newton steps, and those first in which phases are followed over whole turns.
const ROUNDS: usize = 10;
const FOLLOWED: usize = 4;

/// Prior standard deviation of the points' positions, in range cells.
pub(crate) const PLACE_CELLS: f64 = 0.5;

/// Robust passes over the steps of a pulse.
const PASSES: usize = 3;

/// Vector in the plane.
fn flat(axes: [DVec3; 2], [x, y]: [f64; 2]) -> DVec3 {
    axes[0] * x + axes[1] * y
}

/// Displacements accumulated from steps between pulses, the first zero; each step has a prior of zero mean and standard deviation `spread_m`.
pub(crate) fn steps(
    rows: &[Sighted],
    axes: [DVec3; 2],
    turns: usize,
    spread_m: f64,
) -> Vec<[f64; 2]> {
    let mut at = [0.0; 2];
    let mut all = vec![at];
    for n in 1..turns {
        let at_m = flat(axes, at);
        // Phase difference to the previous pulse, and its derivative by a step; C (6.11).
        let turned: Vec<([f64; 2], f64)> = rows
            .iter()
            .map(|row| {
                let model = |n| row.model(n, at_m, DVec3::ZERO);
                let turned =
                    row.values[n - 1].conj() * row.values[n] * cis(model(n - 1) - model(n));
                let slopes = row.slopes(n, axes, at_m, DVec3::ZERO);
                (slopes, libm::atan2(turned.im, turned.re))
            })
            .collect();
        let mut step = [0.0; 2];
        for _ in 0..PASSES {
            let prior = 1.0 / (spread_m * spread_m);
            let (mut a, mut b, mut d) = (prior, 0.0, prior);
            let mut right = [0.0; 2];
            for (row, &([s0, s1], phase)) in rows.iter().zip(&turned) {
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

/// Refine displacements by Gauss-Newton steps. `points` is the number of points; the priors are the standard deviations of displacements and positions, metres.
/// Returns the mean relative loss of the points' peak power: `2 - 2 cos` of the residual phases, plus
/// `(pi r / cell)^2 / 3` of a sinc in range for the range shifts `r` of the positions.
pub(crate) fn refine(
    rows: &[Sighted],
    axes: [DVec3; 2],
    points: usize,
    [displacement_m, place_m]: [f64; 2],
    solved: &mut Solved,
) -> f64 {
    let turns = solved.displacements.len();
    let size = rows.len() + 2 * points;
    let mut places = vec![[0.0; 2]; points];
    // Phase of each history after correction by the present displacements.
    let constant = |row: &Sighted, found: &[[f64; 2]]| {
        let each = row.values.iter().zip(found).enumerate();
        let sum: Complex64 = each
            .map(|(n, (value, &x))| value * cis(-row.model(n, flat(axes, x), DVec3::ZERO)))
            .sum();
        libm::atan2(sum.im, sum.re)
    };
    let mut constants: Vec<f64> = rows
        .iter()
        .map(|row| constant(row, &solved.displacements))
        .collect();
    let prior = 1.0 / (displacement_m * displacement_m);
    let residuals = |constants: &[f64], places: &[[f64; 2]], moved: &[[f64; 2]], followed| {
        let of = |(row, &constant): (&Sighted, &f64)| {
            let off_m = flat(axes, places[row.point]);
            let moved_m = moved.iter().map(|&x| flat(axes, x));
            Residuals::of(row, axes, constant, off_m, moved_m, followed)
        };
        rows.iter().zip(constants).map(of).collect::<Vec<_>>()
    };
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
        // A history's constant has no prior; a small weight keeps the system regular.
        for i in 0..rows.len() {
            matrix[i * size + i] += 1e-6;
        }
        let residuals = residuals(&constants, &places, &solved.displacements, round < FOLLOWED);
        let mut kept: Vec<Turn> = Vec::with_capacity(turns);
        for n in 0..turns {
            let [x, y] = solved.displacements[n];
            let [mean_x, mean_y] = solved.expected.get(n).copied().unwrap_or_default();
            let from_mean = [x - mean_x, y - mean_y];
            let turn = Turn::of(rows, n, &residuals, from_mean, prior, size);
            turn.eliminate(rows, &mut matrix, &mut right, size);
            kept.push(turn);
        }
        // The priors make the system regular.
        let factor = Factor::new(size, &matrix, 0.0);
        let Some(y) = factor.and_then(|factor| factor.solved(&right)) else {
            break;
        };
        let mut most = 0.0f64;
        for (turn, x) in kept.iter().zip(&mut solved.displacements) {
            let step = turn.step(&y);
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
            break;
        }
    }
    let left = residuals(&constants, &places, &solved.displacements, false);
    let cell_m = place_m / PLACE_CELLS;
    let loss = |(row, left): (&Sighted, &Residuals)| {
        let pulse = &row.pulses[turns / 2];
        let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, row.place_m);
        let shift_m = 0.5 * gradient.dot(flat(axes, places[row.point]));
        left.spread() + (std::f64::consts::PI * shift_m / cell_m).powi(2) / 3.0
    };
    rows.iter().zip(&left).map(loss).sum::<f64>() / rows.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use subaperture_model::phase_history::Sweep;

    use super::super::chance::gauss;
    use super::super::rigid::without_rigid_motion;
    use subaperture_model::phase_history::Pulse;

    use super::*;

    const WAVELENGTH_M: f64 = 3.9e-3;
    const TURNS: usize = 400;
    const PLACES_M: [[f64; 2]; 6] = [
        [0.6, 3.0],
        [0.1, 4.0],
        [-0.9, 2.2],
        [1.6, 5.6],
        [2.4, 2.6],
        [-2.1, 3.7],
    ];

    /// Recorded position of the antenna and its true displacement: sway of 3 mm, two periods.
    fn track(n: usize) -> ([f64; 2], [f64; 2]) {
        let u = n as f64 / TURNS as f64;
        let sway = |waves: f64| 3e-3 * (std::f64::consts::TAU * waves * u + waves).sin();
        ([u, 0.0], [sway(2.0), sway(1.3)])
    }

    /// Pulses of the recorded track.
    fn pulses() -> Vec<Pulse> {
        let pulse = |n: usize| {
            let [x, y] = track(n).0;
            let at_m = DVec3::new(x, y, 0.0);
            Pulse {
                time_s: n as f64,
                transmitter_m: at_m,
                receiver_m: at_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 0.0,
                start_hz: 77e9,
                step_hz: 1e6,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        (0..TURNS).map(pulse).collect()
    }

    /// Echoes of points at `off_m` from their assumed positions, with noise of the relative power `noise`.
    fn rows<'a>(pulses: &'a [Pulse], off_m: f64, noise: f64) -> Vec<Sighted<'a>> {
        let mut state = 5;
        let k = std::f64::consts::TAU / WAVELENGTH_M;
        let row = |(point, place): (usize, &[f64; 2])| {
            let off = [off_m * gauss(&mut state), off_m * gauss(&mut state)];
            let own = gauss(&mut state);
            let value = |n: usize| {
                let (thought, moved) = track(n);
                let there = [0, 1].map(|i| place[i] - thought[i]);
                let true_there = [0, 1].map(|i| there[i] + off[i] - moved[i]);
                let longer =
                    libm::hypot(true_there[0], true_there[1]) - libm::hypot(there[0], there[1]);
                let error = Complex64::new(gauss(&mut state), gauss(&mut state));
                cis(own - 2.0 * k * longer) + error * (noise / 2.0).sqrt()
            };
            Sighted {
                point,
                place_m: DVec3::new(place[0], place[1], 0.0),
                pulses,
                wavenumbers: vec![k; TURNS],
                values: (0..TURNS).map(value).collect(),
                rest: noise,
            }
        };
        PLACES_M.iter().enumerate().map(row).collect()
    }

    const AXES: [DVec3; 2] = [DVec3::X, DVec3::Y];

    fn found(rows: &[Sighted]) -> Vec<[f64; 2]> {
        let mut solved = Solved {
            displacements: steps(rows, AXES, TURNS, WAVELENGTH_M / 4.0),
            expected: Vec::new(),
        };
        let priors = [8.0 * WAVELENGTH_M, 0.02];
        refine(rows, AXES, PLACES_M.len(), priors, &mut solved);
        solved.displacements
    }

    #[test]
    fn track_is_recovered_from_points_off_by_wavelengths() {
        // 1 cm of position error rotates phases by up to 2 k x 1 cm x 0.4 rad of rotation of the line of sight, two turns.
        let pulses = pulses();
        let displacements = found(&rows(&pulses, 0.01, 1e-4));
        let flat = |v: [f64; 2]| super::flat(AXES, v);
        let antennas: Vec<DVec3> = (0..TURNS).map(|n| flat(track(n).0)).collect();
        let truth: Vec<DVec3> = (0..TURNS).map(|n| flat(track(n).1)).collect();
        let found: Vec<DVec3> = displacements.iter().map(|&d| flat(d)).collect();
        let [truth, found] = [truth, found].map(|d| without_rigid_motion(AXES, &antennas, &d));
        let squares = truth
            .iter()
            .zip(&found)
            .map(|(a, b)| a.distance_squared(*b));
        let rms_m = (squares.sum::<f64>() / TURNS as f64).sqrt();
        println!("{:.1} um rms off", 1e6 * rms_m);
        // A twentieth of a wavelength, at a sway of 3 mm. The remaining error changes phases by less than their noise at the estimated
        // positions: it depends on the noise of 0.01 rad and the prior of the positions.
        assert!(rms_m < WAVELENGTH_M / 20.0, "{rms_m}");
    }

    #[test]
    fn displacement_errors_reach_cramer_rao_bound() {
        let pulses = pulses();
        let rows = rows(&pulses, 0.0, 1e-2);
        let displacements = found(&rows);
        let error = |n: usize| {
            let (_, moved) = track(n);
            [0, 1].map(|i| displacements[n][i] - moved[i])
        };
        // Errors of positions and constants are common to neighbours; the difference of two displacements has twice the variance of
        // one, whose bound is the inverse of the information of its phases.
        let (mut sum, mut bound) = (0.0, 0.0);
        for n in 1..TURNS {
            let (a, b) = (error(n - 1), error(n));
            sum += (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
            let information = rows.iter().fold([0.0; 3], |[p, q, r], row| {
                let [s0, s1] = row.slopes(n, AXES, DVec3::ZERO, DVec3::ZERO);
                let weight = 1.0 / (0.5 * 1e-2);
                [
                    p + weight * s0 * s0,
                    q + weight * s0 * s1,
                    r + weight * s1 * s1,
                ]
            });
            let [p, q, r] = information;
            bound += 2.0 * (p + r) / (p * r - q * q);
        }
        println!("variance over the bound: {:.3}", sum / bound);
        // 800 values determine a variance to 5 %; Cauchy's weights cost 5 %.
        assert!((0.9..1.2).contains(&(sum / bound)), "{}", sum / bound);
    }
}
