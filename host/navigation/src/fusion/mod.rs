//! Fusion of the radar's own motion, a receiver's positions and an inertial solution into one track.
//!
//! The radar measures its motion between pulses to some micrometres, but not its position, and errors of increments accumulate. A receiver measures positions to decimetres. An inertial solution measures attitude and bridges
//! seconds, and drifts. [`fuse`] estimates the most probable track given all measurements over the whole time, so that later measurements improve earlier states (left as future work by Chim 2018, 7.6 and 8.2). It solves
//! nonlinear least squares over the states of all times, whose normal equations have arrowhead form (`arrowhead`). This is a fixed-interval smoother; unlike a forward-backward filter it linearises headings, clocks and lever arms anew
//! in each step, so that the result does not depend on their initial values.
//!
//! **Frame.** Any Cartesian frame with z up: local axes or those of a scene. The heading is the angle from the frame's x axis to the radar's x axis, counterclockwise from above. Times are the radar's; advances of other clocks are
//! estimated.
//!
//! **Scale.** The drift of MPGA is mostly an error of its x, along the array: it depends on directions of arrival, which only the receive baseline and absolute ranges determine. Increments therefore have a slowly varying scale error
//! that is estimated. Positions over tens of metres and the inertial velocity determine it to parts in ten thousand; the remaining error of an aperture is the increments' own noise.
//!
//! **Observability.** Clocks are observable only where velocity or heading change; otherwise a lever arm along the track is equivalent. Horizontal lever arms are observable only where the body turns, their height never; squint only
//! where the body moves. Unobservable parameters keep their prior: see [`Found::is_observed`].
//!
//! **Cost.** States lie at measurements, with increments in between: about 15 kB a state and 240 bytes an increment, and about a second a minute of navigation with 25 states and 1000 increments a second.

mod arrowhead;
mod bundle;
mod doubt;
mod fill;
mod guess;
mod input;
mod of_log;
mod outcome;
mod pivot;
mod solve;
mod terms;
mod timeline;

use std::collections::BTreeMap;

use glam::DMat3;

use subaperture_model::monitor::Monitor;
use subaperture_model::track::{Fix, turned};

pub use input::{Assumed, Increment, Inertial, Inputs, Model, Position};
pub use of_log::{DefaultSigmas, inertial, positions, velocity_walk};
pub use outcome::{Basis, Found, FusionError, Measured, Outlier, Plausible, Sample};

use bundle::Bundle;
use terms::{ARMS, CLOCKS, COMMON, OWN, Of, P, PSI, Problem, SQUINT, State, V};
use timeline::Timeline;

use pivot::MIN_PIVOT;

/// Change of a clock's advance that moves the states, seconds.
const MOVED_S: f64 = 1e-3;
/// Largest number of such moves.
const MAX_MOVES: usize = 6;

/// Fused track and estimated parameters.
pub struct Fused {
    /// States at every measurement and every edge of an increment, in the order of time.
    pub samples: Vec<Sample>,
    /// Advance of the receiver's clock over the radar's, seconds.
    pub receiver_clock_s: Found,
    /// Advance of the inertial clock, seconds.
    pub inertial_clock_s: Found,
    /// Angle from the inertial x axis to the radar's, radians.
    pub squint_rad: Found,
    /// Lever arm from the radar to the receiver's antenna, along the radar's axes, metres.
    pub receiver_arm_m: [Found; 3],
    /// Lever arm from the radar to the reference point of the inertial solution, metres.
    pub inertial_arm_m: [Found; 3],
    /// Relative scale error of the radar's x, at the middle of the time.
    pub scale: Found,
    /// Measurements with a weight below one half.
    pub outliers: Vec<Outlier>,
    /// Sum of squared residuals in standard deviations, as weighted, and its expectation: measurements less unknowns. Both are similar if the stated noise is right.
    pub chi_square: [f64; 2],
    /// Number of least-squares steps.
    pub steps: usize,
    solved: solve::Solved,
    times_s: Vec<f64>,
}

impl Fused {
    /// Random sample of the track: the estimate plus an error with its joint covariance over the whole time, from independent normal numbers. Features that images on several samples share are reliable.
    pub fn plausible(&self, white: impl FnMut() -> f64) -> Plausible {
        let (errors, _) = self.solved.factored.coloured(white);
        let moments = self.solved.state.moments.iter().zip(&errors);
        let all: Vec<[f64; OWN]> = moments
            .map(|(x, error)| std::array::from_fn(|k| x[k] + error[k]))
            .collect();
        Plausible {
            times_s: self.times_s.clone(),
            positions_m: all.iter().map(|x| terms::vector(x, P)).collect(),
            velocities_m_s: all.iter().map(|x| terms::vector(x, V)).collect(),
            headings_rad: all.iter().map(|x| x[PSI]).collect(),
        }
    }

    /// The track as fixes.
    pub fn fixes(&self) -> Vec<Fix> {
        let fix = |sample: &Sample| Fix {
            time_s: sample.time_s,
            position_m: sample.position_m,
            attitude: Some(sample.attitude),
        };
        self.samples.iter().map(fix).collect()
    }
}

/// Estimate the most probable track given all measurements.
///
/// # Errors
/// [`FusionError`].
pub fn fuse(
    inputs: &Inputs<'_>,
    model: &Model,
    monitor: &dyn Monitor,
) -> Result<Fused, FusionError> {
    inputs.check()?;
    model.check()?;
    let doubted = doubt::outliers(inputs.increments, model);
    let mut clocks_s = [model.receiver_clock_s.value, model.inertial_clock_s.value];
    for turn in 0.. {
        let problem = problem(*inputs, model, &doubted, clocks_s);
        let mut state = State {
            moments: guess::guess(
                inputs,
                &problem.timeline,
                &problem.bundles,
                clocks_s,
                model.squint_rad.value,
            ),
            common: [0.0; COMMON],
        };
        for (k, value, _) in terms::assumed(model) {
            state.common[k] = value;
        }
        for (k, clock_s) in CLOCKS.into_iter().zip(clocks_s) {
            state.common[k] = clock_s;
        }
        let done = turn as f64 / MAX_MOVES as f64;
        let progress = |share: f64| monitor.progress((done + share / MAX_MOVES as f64).min(1.0));
        let problem = Problem {
            about: state.moments[0],
            ..problem
        };
        let solved = solve::solve(&problem, state, monitor, progress)?;
        let found = CLOCKS.map(|k| solved.state.common[k]);
        let off = (found[0] - clocks_s[0])
            .abs()
            .max((found[1] - clocks_s[1]).abs());
        if off > MOVED_S && turn < MAX_MOVES {
            clocks_s = found;
            continue;
        }
        monitor.progress(1.0);
        return Ok(result(&problem, solved, &doubted));
    }
    Err(FusionError::NoPosition)
}

/// Largest ratio of stated deviations after a correction of an inertial solution to those before it.
const CORRECTED: f64 = 0.5;

/// Standard deviations of position and velocity of the inertial solution before its corrections, by the first state after each.
fn corrections(inputs: &Inputs<'_>, timeline: &Timeline) -> BTreeMap<usize, [f64; 2]> {
    let states = inputs.inertial.windows(2).zip(timeline.inertial.windows(2));
    let correction = |(pair, places): (&[Inertial], &[(usize, f64)])| {
        let [before_m, after_m] =
            [0, 1].map(|n| pair[n].position_m.map(|[_, sigma]| sigma.max_element()));
        let (before_m, after_m) = before_m.zip(after_m)?;
        let velocity_m_s = pair[0]
            .velocity_m_s
            .map_or(0.0, |[_, sigma]| sigma.max_element());
        let (from, to) = (places[0].0, places[1].0);
        (after_m < CORRECTED * before_m && to > from).then_some((to, [before_m, velocity_m_s]))
    };
    states.filter_map(correction).collect()
}

/// States, and measurements between them.
fn problem<'a>(
    inputs: Inputs<'a>,
    model: &'a Model,
    doubted: &[usize],
    clocks_s: [f64; 2],
) -> Problem<'a> {
    let timeline = Timeline::new(&inputs, doubted, clocks_s);
    let bundle = |range: &Option<std::ops::Range<usize>>| {
        range
            .clone()
            .map(|range| Bundle::of(&inputs.increments[range]))
    };
    let bundles: Vec<Option<Bundle>> = timeline.intervals.iter().map(bundle).collect();
    let rate = |i: usize| {
        let of = |i: usize| {
            let dt = timeline.times_s[i + 1] - timeline.times_s[i];
            Some(bundles.get(i)?.as_ref()?.moved[2] / dt)
        };
        let before = i.checked_sub(1).and_then(of);
        let after = if i < bundles.len() { of(i) } else { None };
        match (before, after) {
            (Some(a), Some(b)) => (a + b) / 2.0,
            (a, b) => a.or(b).unwrap_or(0.0),
        }
    };
    let tilt = |&time_s: &f64| {
        let all = inputs.inertial;
        let time_s = time_s + clocks_s[1];
        let after = all.partition_point(|one| one.time_s <= time_s);
        let [roll, pitch] = match (after.checked_sub(1).map(|n| &all[n]), all.get(after)) {
            (Some(a), Some(b)) => {
                let u = (time_s - a.time_s) / (b.time_s - a.time_s);
                [0, 1]
                    .map(|k| a.roll_pitch_rad[k] + u * (b.roll_pitch_rad[k] - a.roll_pitch_rad[k]))
            }
            (Some(one), None) | (None, Some(one)) => one.roll_pitch_rad,
            (None, None) => [0.0; 2],
        };
        let squint = DMat3::from_quat(turned(0.0, 0.0, model.squint_rad.value));
        squint.transpose() * DMat3::from_quat(turned(roll, pitch, 0.0)) * squint
    };
    Problem {
        inputs,
        model,
        corrections: corrections(&inputs, &timeline),
        rates: (0..timeline.times_s.len()).map(rate).collect(),
        tilts: timeline.times_s.iter().map(tilt).collect(),
        bundles,
        timeline,
        clocks_s,
        about: [0.0; OWN],
    }
}

/// Fused track from the solved least squares.
fn result(problem: &Problem<'_>, solved: solve::Solved, doubted: &[usize]) -> Fused {
    let covariances = solved.factored.covariances();
    let mut believed: Vec<bool> = problem.bundles.iter().map(Option::is_some).collect();
    let rejected = |&n: &usize| Outlier {
        of: Measured::Increments,
        time_s: problem.inputs.increments[n].from_s,
        weight: 0.0,
    };
    let mut outliers: Vec<Outlier> = doubted.iter().map(rejected).collect();
    let mut expected = 0.0;
    let times_s = &problem.timeline.times_s;
    solve::weights(
        problem,
        &solved.state,
        &covariances,
        &mut |of, weight, left| {
            expected += left;
            if weight >= 0.5 {
                return;
            }
            let (measured, moment, late_s) = match of {
                Of::Radar(i) => {
                    believed[i] = false;
                    (Measured::Increments, i, 0.0)
                }
                Of::Position(n) => {
                    let (moment, late_s) = problem.timeline.positions[n];
                    (Measured::Position, moment, late_s)
                }
                Of::Velocity(n) => {
                    let (moment, late_s) = problem.timeline.positions[n];
                    (Measured::Velocity, moment, late_s)
                }
                Of::Inertial(n, part) => {
                    let (moment, late_s) = problem.timeline.inertial[n];
                    let measured = match part {
                        0 => Measured::InertialPosition,
                        1 => Measured::InertialVelocity,
                        _ => Measured::InertialHeading,
                    };
                    (measured, moment, late_s)
                }
                Of::Model => return,
            };
            outliers.push(Outlier {
                of: measured,
                time_s: times_s[moment] + late_s,
                weight,
            });
        },
    );
    let (known, common) = covariances;
    let assumed: Vec<(usize, f64)> = terms::assumed(problem.model)
        .map(|(k, _, sigma)| (k, sigma))
        .collect();
    let found = |k: usize| Found {
        value: solved.state.common[k],
        sigma: common[k][k].sqrt(),
        assumed_sigma: assumed
            .iter()
            .find(|one| one.0 == k)
            .map_or(0.0, |one| one.1),
    };
    let arm = |which: usize| [0, 1, 2].map(|k| found(ARMS[which] + k));
    let middle = solved.state.moments.len() / 2;
    Fused {
        samples: fill::fill(problem, &solved, &known, &believed),
        receiver_clock_s: found(CLOCKS[0]),
        inertial_clock_s: found(CLOCKS[1]),
        squint_rad: found(SQUINT),
        receiver_arm_m: arm(0),
        inertial_arm_m: arm(1),
        scale: Found {
            value: solved.state.moments[middle][terms::S],
            sigma: known[middle].own[terms::S][terms::S].sqrt(),
            assumed_sigma: problem.model.scale,
        },
        outliers,
        chi_square: [solved.sum, expected],
        steps: solved.steps,
        times_s: times_s.clone(),
        solved,
    }
}
