//! Interpolation of the track between estimated states.
//!
//! Between two states the radar's own motion is kept, and its disagreement with the states is distributed by its uncertainty. In the axes at the first state, with `C_k` the covariance of its motion up to k, `F` the transition from
//! k to the end n, and `e` the disagreement,
//!
//! ```text
//! motion_k + C_k F' C_n^-1 e,      covariance C_k - C_k F' C_n^-1 F C_k'  plus that of the ends
//! ```
//!
//! as a smoother over every increment would yield. Motion along the body's own z, and all motion where the radar did not measure or was an outlier, is the cubic through positions and velocities of both states: the mean for
//! white acceleration, with variance `q^2 dt^3 u^3 (1 - u)^3 / 3` at the fraction u of the time.

use glam::{DQuat, DVec3};

use super::MIN_PIVOT;
use super::bundle::{Bundle, turn_of};
use super::solve::{Known, Solved};
use super::terms::{OWN, P, PSI, Problem, S, V, vector, wrapped};
use super::{Basis, Sample};
use subaperture_signal::dense::fixed::{Matrix, factor, inverse, less, plus, times, transposed};

/// Rows and columns of position and heading.
const PLACE: [usize; 4] = [P, P + 1, P + 2, PSI];

fn attitude(problem: &Problem<'_>, moment: usize, heading_rad: f64) -> DQuat {
    DQuat::from_mat3(&problem.axes(moment, heading_rad)).normalize()
}

/// Track at every state and every edge of an increment.
pub(super) fn fill(
    problem: &Problem<'_>,
    solved: &Solved,
    known: &[Known],
    believed: &[bool],
) -> Vec<Sample> {
    let moments = &solved.state.moments;
    let mut samples = Vec::new();
    for (i, x) in moments.iter().enumerate() {
        let own = &known[i].own;
        samples.push(Sample {
            time_s: problem.timeline.times_s[i],
            position_m: vector(x, P),
            velocity_m_s: vector(x, V),
            heading_rad: x[PSI],
            attitude: attitude(problem, i, x[PSI]),
            covariance: PLACE.map(|a| PLACE.map(|b| own[a][b])),
            basis: match believed.get(i).or(believed.last()) {
                Some(true) => Basis::Radar,
                _ => Basis::Bridged,
            },
        });
        if let (Some(range), Some(next), Some(bundle)) = (
            problem.timeline.intervals.get(i).cloned().flatten(),
            moments.get(i + 1),
            problem.bundles.get(i).and_then(Option::as_ref),
        ) {
            let interval = Interval {
                problem,
                i,
                ends: [x, next],
                known: &known[i..i + 2],
            };
            samples.extend(interval.between(range, believed[i].then_some(bundle)));
        }
    }
    samples
}

/// Interval between two states.
struct Interval<'a> {
    problem: &'a Problem<'a>,
    i: usize,
    ends: [&'a [f64; OWN]; 2],
    known: &'a [Known],
}

impl Interval<'_> {
    /// Samples at the edges of increments between the states, with or without the radar's motion.
    fn between(&self, range: std::ops::Range<usize>, whole: Option<&Bundle>) -> Vec<Sample> {
        let [x, y] = self.ends;
        let increments = &self.problem.inputs.increments[range];
        let axes = self.problem.axes(self.i, x[PSI]);
        let made_up = whole.and_then(|whole| {
            let inverse = inverse(&factor(&whole.covariance, MIN_PIVOT)?);
            let off = self.problem.disagreement(self.i, whole, x, y);
            Some((whole, inverse, off.map(|value| [value])))
        });
        let mut so_far = Bundle::new();
        let mut samples = Vec::with_capacity(increments.len());
        for one in &increments[..increments.len() - 1] {
            so_far.push(one);
            let mut sample = self.curve(one.to_s);
            if let Some((whole, inverse, off)) = &made_up {
                let onward = so_far.onward(whole);
                let gain = times(&times(&so_far.covariance, &transposed(&onward)), inverse);
                let extra = times(&gain, off);
                let level = axes.transpose() * (sample.position_m - vector(x, P));
                let along = |k: usize| so_far.moved[k] + so_far.by_scale[k] * x[S] + extra[k][0];
                let motion = DVec3::new(along(0), along(1), level.z);
                sample.position_m = vector(x, P) + axes * motion;
                sample.heading_rad = x[PSI] + so_far.moved[2] + extra[2][0];
                sample.attitude = attitude(self.problem, self.i, sample.heading_rad);
                sample.basis = Basis::Radar;
                self.spread(&mut sample, &so_far, whole, &gain, &onward);
            }
            samples.push(sample);
        }
        samples
    }

    /// Sample from positions and velocities of both states alone (cubic).
    fn curve(&self, time_s: f64) -> Sample {
        let [x, y] = self.ends;
        let times_s = &self.problem.timeline.times_s[self.i..self.i + 2];
        let dt = times_s[1] - times_s[0];
        let u = (time_s - times_s[0]) / dt;
        let (p, q) = (vector(x, P), vector(y, P));
        let (v, w) = (vector(x, V) * dt, vector(y, V) * dt);
        let (u2, u3) = (u * u, u * u * u);
        let place = p * (2.0 * u3 - 3.0 * u2 + 1.0)
            + v * (u3 - 2.0 * u2 + u)
            + q * (3.0 * u2 - 2.0 * u3)
            + w * (u3 - u2);
        let slope = (q - p) * (6.0 * u - 6.0 * u2)
            + v * (3.0 * u2 - 4.0 * u + 1.0)
            + w * (3.0 * u2 - 2.0 * u);
        let heading_rad = x[PSI] + u * wrapped(y[PSI] - x[PSI]);
        let model = self.problem.model;
        let blended = |a: usize, b: usize| {
            let [first, second] = [0, 1].map(|n| self.known[n].own[PLACE[a]][PLACE[b]]);
            first + u * (second - first)
        };
        let mut covariance = [0, 1, 2, 3].map(|a| [0, 1, 2, 3].map(|b| blended(a, b)));
        let away = dt * dt * dt * u3 * (1.0 - u) * (1.0 - u) * (1.0 - u) / 3.0;
        let densities = [
            model.acceleration,
            model.acceleration,
            model.acceleration_up,
        ];
        for (k, density) in densities.into_iter().enumerate() {
            covariance[k][k] += density * density * away;
        }
        covariance[3][3] += model.turning * model.turning * dt * u * (1.0 - u);
        Sample {
            time_s,
            position_m: place,
            velocity_m_s: slope / dt,
            heading_rad,
            attitude: attitude(self.problem, self.i, heading_rad),
            covariance,
            basis: Basis::Bridged,
        }
    }

    /// Covariance of position in the plane and heading, from both states and the motion between.
    fn spread(
        &self,
        sample: &mut Sample,
        so_far: &Bundle,
        whole: &Bundle,
        gain: &Matrix<3, 3>,
        onward: &Matrix<3, 3>,
    ) {
        let (sin, cos) = libm::sincos(self.ends[0][PSI]);
        // To the axes at the first state, in plan view.
        let level = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
        let part = |matrix: &Matrix<OWN, OWN>| -> Matrix<3, 3> {
            let at = [P, P + 1, PSI];
            let part = at.map(|a| at.map(|b| matrix[a][b]));
            times(&times(&level, &part), &transposed(&level))
        };
        let [first, second] = [0, 1].map(|n| part(&self.known[n].own));
        let both = part(&self.known[0].next);
        let mut of_first = turn_of([-so_far.moved[1], so_far.moved[0]]);
        let by_end = times(gain, &turn_of([-whole.moved[1], whole.moved[0]]));
        for (row, values) in of_first.iter_mut().zip(by_end) {
            for (value, by_end) in row.iter_mut().zip(values) {
                *value -= by_end;
            }
        }
        let cross = times(&times(&of_first, &both), &transposed(gain));
        let ends = plus(
            &times(&times(&of_first, &first), &transposed(&of_first)),
            &times(&times(gain, &second), &transposed(gain)),
        );
        let mut spread = plus(
            &plus(&ends, &cross),
            &plus(&transposed(&cross), &so_far.covariance),
        );
        let carried = times(onward, &so_far.covariance);
        less(&mut spread, &transposed(gain), &carried);
        let level = transposed(&level);
        let spread = times(&times(&level, &spread), &transposed(&level));
        let at = [0, 1, 3];
        for (a, row) in at.into_iter().zip(spread) {
            for (b, value) in at.into_iter().zip(row) {
                sample.covariance[a][b] = value;
            }
        }
    }
}
