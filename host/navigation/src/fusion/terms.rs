//! Residuals of measurements and priors.
//!
//! Unknowns of the state at time i, and common unknowns:
//!
//! | unknowns | meaning |
//! |---|---|
//! | p (3), v (3), psi | position, velocity and heading of the radar |
//! | b (3), c (3), h | errors of the inertial solution: position, velocity, heading |
//! | s | relative scale error of the radar's x |
//! | d_r, d_n | advances of the receiver's and the inertial clock |
//! | k | squint: from the inertial x axis to the radar's |
//! | l_r (3), l_n (3) | lever arms of both, along the radar's axes |
//!
//! With `R = Rz(psi) B` the body's axes (`B` the tilt, from the inertial solution), `w` the rate of turn (from increments), `u = v + w z x (R l)` the velocity of a lever arm's end and `t` the time from the state to the measurement by
//! the estimated clocks:
//!
//! ```text
//! positions     p + R l_r + u t                  = measured        (velocities: u)
//! inertial      p + R l_n + u t + b              = measured        (u + c;  psi + w t - k + h)
//! increments    (R_i' (p_(i+1) - p_i))_xy        = (x, y)(s)       psi_(i+1) - psi_i = turn
//! motion        p' = v, v' = noise, psi' = noise
//! errors        b' = c + noise, c' = noise, h' = noise, s' = -s / T + noise
//! ```
//!
//! **Corrections.** A receiver that has positions again corrects its inertial solution at once: the stated deviations fall, and errors before and after
//! are independent. The noise of `b` and `c` in that interval is then as large as the errors before it.
//!
//! Each residual is left less right side over the standard deviation. Positions are three-dimensional and increments planar: motion along the body's own z is left to the motion model, positions and the inertial solution. (A
//! two-dimensional model with separate height would be equivalent for a level body, and wrong for one that climbs.)

use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::MIN_PIVOT;
use super::bundle::Bundle;
use super::timeline::Timeline;
use super::{Inputs, Model};
use subaperture_signal::dense::fixed::{factor, forward};

/// Numbers of unknowns of a state, and of common unknowns.
pub(super) const OWN: usize = 15;
pub(super) const COMMON: usize = 9;
const ALL: usize = 2 * OWN + COMMON;

/// Indices of the unknowns.
pub(super) const P: usize = 0;
pub(super) const V: usize = 3;
pub(super) const PSI: usize = 6;
pub(super) const B: usize = 7;
pub(super) const C: usize = 10;
pub(super) const H: usize = 13;
pub(super) const S: usize = 14;
/// Clocks of the receiver and the inertial solution, squint, lever arms.
pub(super) const CLOCKS: [usize; 2] = [0, 1];
pub(super) const SQUINT: usize = 2;
pub(super) const ARMS: [usize; 2] = [3, 6];

/// Standard deviation of a held unknown.
const HELD: f64 = 1e-7;
/// Prior standard deviations of the first position, velocity and heading: next to no information.
const ANYWHERE: [f64; 3] = [1e5, 1e3, 10.0];

/// Values of all unknowns.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) moments: Vec<[f64; OWN]>,
    pub(super) common: [f64; COMMON],
}

/// Origin of a residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    /// Prior.
    Model,
    /// Increments from a state on.
    Radar(usize),
    /// Position of the receiver, by number.
    Position(usize),
    /// Velocity of a receiver.
    Velocity(usize),
    /// Position, velocity and heading of an inertial state.
    Inertial(usize, usize),
}

/// Residual over its standard deviation, with derivatives by this state, the next and the common unknowns.
#[derive(Clone, Copy)]
pub(super) struct Row {
    pub(super) off: f64,
    pub(super) slope: [f64; ALL],
}

/// Rows in progress.
struct Rows<'a> {
    rows: [Row; 6],
    used: usize,
    take: &'a mut dyn FnMut(Of, usize, &[Row]),
}

impl Rows<'_> {
    fn row(&mut self, off: f64) -> &mut [f64; ALL] {
        self.rows[self.used] = Row {
            off,
            slope: [0.0; ALL],
        };
        self.used += 1;
        &mut self.rows[self.used - 1].slope
    }

    fn done(&mut self, of: Of, moment: usize) {
        (self.take)(of, moment, &self.rows[..self.used]);
        self.used = 0;
    }
}

/// Wrap an angle to half a turn about 0.
pub(super) fn wrapped(angle: f64) -> f64 {
    let turns = (angle / TAU).round();
    (angle - turns * TAU).clamp(-PI, PI)
}

pub(super) fn vector(values: &[f64], at: usize) -> DVec3 {
    DVec3::new(values[at], values[at + 1], values[at + 2])
}

/// Measurements and priors for given states.
pub(super) struct Problem<'a> {
    pub(super) inputs: Inputs<'a>,
    pub(super) model: &'a Model,
    pub(super) timeline: Timeline,
    /// Composed increments of each interval that has any.
    pub(super) bundles: Vec<Option<Bundle>>,
    /// Tilt of the body at each state.
    pub(super) tilts: Vec<DMat3>,
    /// Standard deviations of position (metres) and velocity (m/s) of the inertial solution before a correction between a state and the next, by
    /// the next state.
    pub(super) corrections: BTreeMap<usize, [f64; 2]>,
    /// Rate of turn at each state, rad/s.
    pub(super) rates: Vec<f64>,
    /// Advances of the clocks for which the states were chosen.
    pub(super) clocks_s: [f64; 2],
    /// Prior of the first position and heading.
    pub(super) about: [f64; OWN],
}

impl Problem<'_> {
    /// Axes of the body.
    pub(super) fn axes(&self, moment: usize, heading_rad: f64) -> DMat3 {
        let (sin, cos) = libm::sincos(heading_rad);
        let turn = DMat3::from_cols(
            DVec3::new(cos, sin, 0.0),
            DVec3::new(-sin, cos, 0.0),
            DVec3::Z,
        );
        turn * self.tilts[moment]
    }

    /// Pass all residuals to `take`, each with its state.
    pub(super) fn terms(&self, state: &State, take: &mut dyn FnMut(Of, usize, &[Row])) {
        let empty = Row {
            off: 0.0,
            slope: [0.0; ALL],
        };
        let mut rows = Rows {
            rows: [empty; 6],
            used: 0,
            take,
        };
        self.priors(state, &mut rows);
        for i in 0..self.bundles.len() {
            self.motion(state, i, &mut rows);
            if let Some(bundle) = &self.bundles[i] {
                self.radar(state, i, bundle, &mut rows);
            }
        }
        for (n, (one, &(i, late_s))) in self
            .inputs
            .positions
            .iter()
            .zip(&self.timeline.positions)
            .enumerate()
        {
            let arm = Arm::new(self, state, i, 0, late_s);
            arm.place(one.position_m, one.sigma_m, false, &mut rows);
            rows.done(Of::Position(n), i);
            if let Some([velocity, sigma]) = one.velocity_m_s {
                arm.velocity(velocity, sigma, false, &mut rows);
                rows.done(Of::Velocity(n), i);
            }
        }
        for (n, (one, &(i, late_s))) in self
            .inputs
            .inertial
            .iter()
            .zip(&self.timeline.inertial)
            .enumerate()
        {
            let arm = Arm::new(self, state, i, 1, late_s);
            if let Some([place, sigma]) = one.position_m {
                arm.place(place, sigma, true, &mut rows);
                rows.done(Of::Inertial(n, 0), i);
            }
            if let Some([velocity, sigma]) = one.velocity_m_s {
                arm.velocity(velocity, sigma, true, &mut rows);
                rows.done(Of::Inertial(n, 1), i);
            }
            if let Some([heading, sigma]) = one.heading_rad {
                let x = &state.moments[i];
                let rate = self.rates[i];
                let stated = x[PSI] + rate * arm.late_s - state.common[SQUINT] + x[H];
                let slope = rows.row(wrapped(stated - heading) / sigma);
                slope[PSI] = 1.0 / sigma;
                slope[H] = 1.0 / sigma;
                slope[2 * OWN + SQUINT] = -1.0 / sigma;
                slope[2 * OWN + CLOCKS[1]] = -rate / sigma;
                rows.done(Of::Inertial(n, 2), i);
            }
        }
    }

    /// Priors.
    fn priors(&self, state: &State, rows: &mut Rows<'_>) {
        let model = self.model;
        let scale = model.scale.max(HELD);
        let first = [
            (P, 3, ANYWHERE[0]),
            (V, 3, ANYWHERE[1]),
            (PSI, 1, ANYWHERE[2]),
            (B, 3, model.inertial_position[0]),
            (C, 3, model.inertial_velocity[0]),
            // The constant part is squint.
            (H, 1, HELD),
            (S, 1, scale),
        ];
        let parts = first
            .iter()
            .flat_map(|&(from, count, sigma)| (from..from + count).map(move |k| (k, sigma)));
        for (k, sigma) in parts {
            let slope = rows.row((state.moments[0][k] - self.about[k]) / sigma);
            slope[k] = 1.0 / sigma;
            rows.done(Of::Model, 0);
        }
        for (k, value, sigma) in assumed(model) {
            let sigma = sigma.max(HELD);
            let slope = rows.row((state.common[k] - value) / sigma);
            slope[2 * OWN + k] = 1.0 / sigma;
            rows.done(Of::Model, 0);
        }
    }

    /// Motion model from a state to the next.
    fn motion(&self, state: &State, i: usize, rows: &mut Rows<'_>) {
        let (x, y) = (&state.moments[i], &state.moments[i + 1]);
        let dt = self.timeline.times_s[i + 1] - self.timeline.times_s[i];
        let model = self.model;
        // Noise of these densities on a quantity and on its derivative.
        let mut pair = |at: usize, rate: usize, of_number: f64, of_rate: f64| {
            let [q, r] = [of_number * of_number, of_rate * of_rate];
            let number = (q * dt + r * dt * dt * dt / 3.0).sqrt();
            let with = r * dt * dt / 2.0 / number;
            let left = (r * dt - with * with).sqrt();
            let off = y[at] - x[at] - x[rate] * dt;
            let slope = rows.row(off / number);
            slope[at] = -1.0 / number;
            slope[rate] = -dt / number;
            slope[OWN + at] = 1.0 / number;
            let first = *slope;
            let share = with / left;
            let slope = rows.row((y[rate] - x[rate]) / left - share * off / number);
            for (value, first) in slope.iter_mut().zip(first) {
                *value = -share * first;
            }
            slope[rate] -= 1.0 / left;
            slope[OWN + rate] += 1.0 / left;
            rows.done(Of::Model, i);
        };
        // A correction adds the variances of the errors before it.
        let inertial = match self.corrections.get(&(i + 1)) {
            None => [model.inertial_position[1], model.inertial_velocity[1]],
            Some(sigmas) => {
                let walk = [model.inertial_position[1], model.inertial_velocity[1]];
                [0, 1].map(|k| libm::hypot(walk[k], sigmas[k] / dt.sqrt()))
            }
        };
        for k in 0..3 {
            let acceleration = [
                model.acceleration,
                model.acceleration,
                model.acceleration_up,
            ][k];
            pair(P + k, V + k, 0.0, acceleration);
            pair(B + k, C + k, inertial[0], inertial[1]);
        }
        let keep = libm::exp(-dt / model.scale_time_s);
        let scale = model.scale.max(HELD) * (1.0 - keep * keep).sqrt().max(1e-6);
        let wander = [
            (
                PSI,
                wrapped(y[PSI] - x[PSI]),
                1.0,
                model.turning * dt.sqrt(),
            ),
            (H, y[H] - x[H], 1.0, model.inertial_heading * dt.sqrt()),
            (S, y[S] - keep * x[S], keep, scale),
        ];
        for (k, off, keep, sigma) in wander {
            let slope = rows.row(off / sigma);
            slope[k] = -keep / sigma;
            slope[OWN + k] = 1.0 / sigma;
            rows.done(Of::Model, i);
        }
    }

    /// Increments from a state to the next.
    fn radar(&self, state: &State, i: usize, bundle: &Bundle, rows: &mut Rows<'_>) {
        let (x, y) = (&state.moments[i], &state.moments[i + 1]);
        let Some(lower) = factor(&bundle.covariance, MIN_PIVOT) else {
            return;
        };
        let axes = self.axes(i, x[PSI]);
        let moved = vector(y, P) - vector(x, P);
        let [off_x, off_y, turn] = self.disagreement(i, bundle, x, y);
        // Columns: residuals of x, y and turn, and their derivatives.
        let mut columns = [[0.0; ALL + 1]; 3];
        columns[0][ALL] = off_x;
        columns[1][ALL] = off_y;
        columns[2][ALL] = turn;
        // A rotation of the body rotates the observed motion in the opposite sense.
        let by_turn = axes.transpose() * -DVec3::Z.cross(moved);
        for (k, column) in columns.iter_mut().take(2).enumerate() {
            let axis = axes.col(k).to_array();
            for (j, part) in axis.into_iter().enumerate() {
                column[P + j] = -part;
                column[OWN + P + j] = part;
            }
            column[PSI] = by_turn[k];
            column[S] = -bundle.by_scale[k];
        }
        columns[2][PSI] = -1.0;
        columns[2][OWN + PSI] = 1.0;
        forward(&lower, &mut columns);
        for column in columns {
            let slope = rows.row(column[ALL]);
            slope.copy_from_slice(&column[..ALL]);
        }
        rows.done(Of::Radar(i), i);
    }

    /// Motion from a state to the next less that of the radar: x and y in the body's axes, and turn.
    pub(super) fn disagreement(
        &self,
        i: usize,
        bundle: &Bundle,
        x: &[f64; OWN],
        y: &[f64; OWN],
    ) -> [f64; 3] {
        let moved = vector(y, P) - vector(x, P);
        let seen = self.axes(i, x[PSI]).transpose() * moved;
        [
            seen.x - bundle.moved[0] - bundle.by_scale[0] * x[S],
            seen.y - bundle.moved[1] - bundle.by_scale[1] * x[S],
            wrapped(y[PSI] - x[PSI] - bundle.moved[2]),
        ]
    }
}

/// Common unknowns: index, prior mean and standard deviation.
pub(super) fn assumed(model: &Model) -> impl Iterator<Item = (usize, f64, f64)> {
    let plain = [
        (CLOCKS[0], model.receiver_clock_s),
        (CLOCKS[1], model.inertial_clock_s),
        (SQUINT, model.squint_rad),
    ];
    let arms = [
        (ARMS[0], model.receiver_arm_m),
        (ARMS[1], model.inertial_arm_m),
    ];
    let arms = arms
        .into_iter()
        .flat_map(|(at, arm)| (0..3).map(move |k| (at + k, arm.value[k], arm.sigma[k])));
    plain
        .into_iter()
        .map(|(at, one)| (at, one.value, one.sigma))
        .chain(arms)
}

/// End of a lever arm at a measurement's time.
struct Arm<'a> {
    x: &'a [f64; OWN],
    which: usize,
    axes: DMat3,
    /// Offset from the radar.
    arm: DVec3,
    /// Velocity of its end.
    velocity: DVec3,
    rate: f64,
    /// Time from the state to the measurement.
    late_s: f64,
}

impl<'a> Arm<'a> {
    fn new(problem: &Problem<'_>, state: &'a State, i: usize, which: usize, late_s: f64) -> Self {
        let x = &state.moments[i];
        let axes = problem.axes(i, x[PSI]);
        let arm = axes * vector(&state.common, ARMS[which]);
        let rate = problem.rates[i];
        Self {
            x,
            which,
            axes,
            arm,
            velocity: vector(x, V) + rate * DVec3::Z.cross(arm),
            rate,
            late_s: late_s - (state.common[CLOCKS[which]] - problem.clocks_s[which]),
        }
    }

    fn place(&self, measured: DVec3, sigma: DVec3, drifts: bool, rows: &mut Rows<'_>) {
        let drift = if drifts {
            vector(self.x, B)
        } else {
            DVec3::ZERO
        };
        let stated = vector(self.x, P) + self.arm + self.velocity * self.late_s + drift;
        let by_turn = DVec3::Z.cross(self.arm);
        for k in 0..3 {
            let share = 1.0 / sigma[k];
            let slope = rows.row((stated[k] - measured[k]) * share);
            slope[P + k] = share;
            slope[V + k] = self.late_s * share;
            slope[PSI] = by_turn[k] * share;
            if drifts {
                slope[B + k] = share;
            }
            slope[2 * OWN + CLOCKS[self.which]] = -self.velocity[k] * share;
            for j in 0..3 {
                slope[2 * OWN + ARMS[self.which] + j] = self.axes.col(j)[k] * share;
            }
        }
    }

    fn velocity(&self, measured: DVec3, sigma: DVec3, drifts: bool, rows: &mut Rows<'_>) {
        let drift = if drifts {
            vector(self.x, C)
        } else {
            DVec3::ZERO
        };
        let stated = self.velocity + drift;
        let by_turn = self.rate * DVec3::Z.cross(DVec3::Z.cross(self.arm));
        for k in 0..3 {
            let share = 1.0 / sigma[k];
            let slope = rows.row((stated[k] - measured[k]) * share);
            slope[V + k] = share;
            slope[PSI] = by_turn[k] * share;
            if drifts {
                slope[C + k] = share;
            }
            for j in 0..3 {
                let by_arm = self.rate * DVec3::Z.cross(self.axes.col(j));
                slope[2 * OWN + ARMS[self.which] + j] = by_arm[k] * share;
            }
        }
    }
}
