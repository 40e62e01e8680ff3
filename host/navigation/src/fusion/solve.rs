//! Gauss-Newton least squares with robust weights.
//!
//! Terms of the radar, of positions and of the inertial solution are vectors of d numbers over their standard deviations; three in a thousand Gaussian ones exceed `a = sqrt(d) + 2`. The iteration has three stages. First all
//! terms have full weight. Then terms beyond `a` count by their length alone (Huber): the solution is unique and reveals outliers. At last the weight falls beyond `2 a` and is 0 beyond `4 a` (Hampel), so that no outlier affects
//! the result, however far it is off.

use subaperture_model::monitor::Monitor;

use super::FusionError;
use super::arrowhead::{Arrowhead, Covariance, Factored};
use super::terms::{COMMON, OWN, Of, Problem, Row, State};
use subaperture_signal::dense::fixed::Matrix;

/// Largest number of steps of each stage.
const MAX_STEPS: usize = 40;
/// Predicted decrease of the sum of squares below which a stage ends: no unknown moves by more than a hundredth of its standard deviation.
const MIN_DECREASE: f64 = 1e-4;

/// Weight function.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Count {
    Full,
    Huber,
    Hampel,
}

/// Weight of a term of `count` numbers and length `off`, and its contribution to the sum.
fn weight(how: Count, count: usize, off: f64) -> (f64, f64) {
    let a = (count as f64).sqrt() + 2.0;
    let (b, c) = (2.0 * a, 4.0 * a);
    match how {
        Count::Full => (1.0, off * off),
        _ if off <= a => (1.0, off * off),
        Count::Huber => (a / off, a * (2.0 * off - a)),
        Count::Hampel if off <= b => (a / off, a * (2.0 * off - a)),
        Count::Hampel => {
            let most = a * (2.0 * b - a) + a * (c - b);
            let left = (c - off).max(0.0);
            (a * left / (c - b) / off, most - a * left * left / (c - b))
        }
    }
}

/// Covariances of a state.
pub(super) type Known = Covariance<OWN, COMMON>;

/// Result of the least squares.
pub(super) struct Solved {
    pub(super) state: State,
    pub(super) factored: Factored<OWN, COMMON>,
    /// Weighted sum of squared residuals of measurements.
    pub(super) sum: f64,
    pub(super) steps: usize,
}

/// Objective function.
fn sum(problem: &Problem<'_>, state: &State, how: Count) -> f64 {
    let mut sum = 0.0;
    problem.terms(state, &mut |of, _, rows| {
        let square: f64 = rows.iter().map(|row| row.off * row.off).sum();
        sum += match of {
            Of::Model => square,
            _ => weight(how, rows.len(), square.sqrt()).1,
        };
    });
    sum
}

fn equations(problem: &Problem<'_>, state: &State, how: Count) -> Arrowhead<OWN, COMMON> {
    let mut system = Arrowhead::new(state.moments.len());
    problem.terms(state, &mut |of, i, rows| {
        let square: f64 = rows.iter().map(|row| row.off * row.off).sum();
        let share = match of {
            Of::Model => 1.0,
            _ => weight(how, rows.len(), square.sqrt()).0,
        };
        if share == 0.0 {
            return;
        }
        for row in rows {
            let filled = row
                .slope
                .iter()
                .enumerate()
                .filter(|(_, slope)| **slope != 0.0);
            for (k, slope) in filled.clone() {
                let weighted = share * slope;
                let right = -weighted * row.off;
                match k / OWN {
                    0 => system.links[i].right[k] += right,
                    1 => system.links[i + 1].right[k - OWN] += right,
                    _ => system.right[k - 2 * OWN] += right,
                }
                for (l, other) in filled.clone() {
                    let product = weighted * other;
                    match (k / OWN, l / OWN) {
                        (0, 0) => system.links[i].own[k][l] += product,
                        (0, 1) => system.links[i].next[k][l - OWN] += product,
                        (1, 1) => system.links[i + 1].own[k - OWN][l - OWN] += product,
                        (0, 2) => system.links[i].common[k][l - 2 * OWN] += product,
                        (1, 2) => system.links[i + 1].common[k - OWN][l - 2 * OWN] += product,
                        (2, 2) => system.common[k - 2 * OWN][l - 2 * OWN] += product,
                        _ => {}
                    }
                }
            }
        }
    });
    system
}

fn moved(state: &State, (moments, common): &(Vec<[f64; OWN]>, [f64; COMMON]), share: f64) -> State {
    let along = |values: &[f64], steps: &[f64], to: &mut [f64]| {
        for ((to, value), step) in to.iter_mut().zip(values).zip(steps) {
            *to = value + share * step;
        }
    };
    let mut next = state.clone();
    for ((to, values), steps) in next.moments.iter_mut().zip(&state.moments).zip(moments) {
        along(values, steps, to);
    }
    along(&state.common, common, &mut next.common);
    next
}

/// Minimise the objective from an initial estimate.
pub(super) fn solve(
    problem: &Problem<'_>,
    mut state: State,
    monitor: &dyn Monitor,
    mut progress: impl FnMut(f64),
) -> Result<Solved, FusionError> {
    let mut steps = 0;
    let indefinite = |i: usize| FusionError::Undetermined {
        time_s: problem.timeline.times_s.get(i).copied(),
    };
    let mut converged = false;
    for (stage, how) in [Count::Full, Count::Huber, Count::Hampel]
        .into_iter()
        .enumerate()
    {
        let mut before = sum(problem, &state, how);
        converged = false;
        for step in 0..MAX_STEPS {
            if monitor.cancelled() {
                return Err(FusionError::Cancelled);
            }
            progress((stage as f64 + step as f64 / MAX_STEPS as f64) / 3.0);
            let system = equations(problem, &state, how);
            let rights: Vec<[f64; OWN]> = system.links.iter().map(|link| link.right).collect();
            let right = system.right;
            let solution = system.factor().map_err(indefinite)?.solution();
            let own = rights.iter().zip(&solution.0);
            let predicted: f64 = own
                .flat_map(|(a, b)| a.iter().zip(b))
                .map(|(a, b)| a * b)
                .sum::<f64>()
                + right
                    .iter()
                    .zip(&solution.1)
                    .map(|(a, b)| a * b)
                    .sum::<f64>();
            if !predicted.is_finite() {
                return Err(FusionError::NoPosition);
            }
            steps += 1;
            let halves = (0..12).map(|n| 0.5f64.powi(n));
            let found = halves.into_iter().find_map(|share| {
                let next = moved(&state, &solution, share);
                let after = sum(problem, &next, how);
                // An increase within the rounding of a large sum is accepted.
                (after <= before + 1e-9 * before.abs()).then_some((next, after))
            });
            let Some((next, after)) = found else {
                converged = predicted < 100.0 * MIN_DECREASE;
                break;
            };
            state = next;
            let gained = before - after;
            before = after;
            if predicted < MIN_DECREASE || (step > 3 && gained.abs() < MIN_DECREASE / 10.0) {
                converged = true;
                break;
            }
            // Full weights only provide a start for the robust stages.
            if how == Count::Full && step >= 5 {
                break;
            }
        }
    }
    if !converged {
        return Err(FusionError::NotConverged { steps });
    }
    let how = Count::Hampel;
    let mut sum = 0.0;
    problem.terms(&state, &mut |of, _, rows| {
        if of != Of::Model {
            let square: f64 = rows.iter().map(|row| row.off * row.off).sum();
            let share = weight(how, rows.len(), square.sqrt()).0;
            sum += share * square;
        }
    });
    let factored = equations(problem, &state, how)
        .factor()
        .map_err(indefinite)?;
    Ok(Solved {
        state,
        factored,
        sum,
        steps,
    })
}

/// Pass each measurement to `take` with its weight, 0 to 1, and its expected weighted squared residual: its numbers minus the degrees of freedom absorbed by the state.
pub(super) fn weights(
    problem: &Problem<'_>,
    state: &State,
    (known, common): &(Vec<Known>, Matrix<COMMON, COMMON>),
    take: &mut dyn FnMut(Of, f64, f64),
) {
    problem.terms(state, &mut |of, i, rows| {
        if of == Of::Model {
            return;
        }
        let square: f64 = rows.iter().map(|row| row.off * row.off).sum();
        let share = weight(Count::Hampel, rows.len(), square.sqrt()).0;
        let spread = |row: &Row| {
            let covariance = |k: usize, l: usize| match (k / OWN, l / OWN) {
                (0, 0) => known[i].own[k][l],
                (0, 1) => known[i].next[k][l - OWN],
                (1, 1) => known[i + 1].own[k - OWN][l - OWN],
                (0, _) => known[i].common[k][l - 2 * OWN],
                (1, _) => known[i + 1].common[k - OWN][l - 2 * OWN],
                _ => common[k - 2 * OWN][l - 2 * OWN],
            };
            let filled: Vec<usize> = (0..row.slope.len())
                .filter(|&k| row.slope[k] != 0.0)
                .collect();
            let pairs = filled
                .iter()
                .flat_map(|&k| filled.iter().map(move |&l| (k, l)));
            let each =
                pairs.map(|(k, l)| row.slope[k] * row.slope[l] * covariance(k.min(l), k.max(l)));
            each.sum::<f64>()
        };
        let left: f64 = rows.iter().map(|row| 1.0 - share * spread(row)).sum();
        take(of, share, share * left);
    });
}
