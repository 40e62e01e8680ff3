//! Whole turns of phase of a track: unwrapping against an estimate, and which turns remain in doubt.
//!
//! A phase is known modulo whole turns. At a pulse, turns `k_i` of targets `i` agree with another pose at the distance `delta`, at the cost in squared standard deviations
//!
//! ```text
//! Q(k) = min over delta of  sum_i sum_c ((2 pi k_i - J_ic . delta) / sigma_i)^2 + sum_i (J_i . delta / sigma_range_i)^2
//! ```
//!
//! `J` the derivatives of phases and ranges by the pose. Where `Q` of every `k` but 0 exceeds [`EXCLUDED`], ranges and the spread of directions exclude any other pose, however the radar moves. Elsewhere
//! an even motion decides: a second difference of phase of more than 0.6 of half a turn agrees almost as well with a motion that is half a wavelength off.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};
use subaperture_signal::dense::Factor;

use crate::MIN_PIVOT;
use crate::increment::{Heading, WRAPPED};
use crate::joint::Estimate;
use crate::model::{Array, Line, Pose, Sighting};

/// Value of `Q` from which another pose is excluded: five standard deviations, squared.
const EXCLUDED: f64 = 25.0;
/// RMS residual of a pulse's phases that another pose, half a wavelength off, leaves: targets in different directions share out their parts of a turn.
const CONTRADICTS_RAD: f64 = 0.5;
/// A fraction of contradicting pulses of up to 1 / `MISFITS` are outliers, more are a wrong track.
const MISFITS: usize = 100;
/// Information of a heading that is held.
const HELD: f64 = 1e12;
/// Weight of all targets relative to the two that determine a candidate pose.
const OTHERS: f64 = 1e-3;

/// Pulses with every phase unwrapped to within half a turn of the estimate.
pub(crate) fn rewrapped(
    array: &Array,
    pulses: &[Vec<Sighting>],
    estimate: &Estimate,
) -> Vec<Vec<Sighting>> {
    let one = |sighting: &Sighting, pose: &Pose| {
        let lines = array.lines(pose, &estimate.targets[sighting.target]);
        let phases = sighting.phases_rad.iter().zip(&lines);
        let phases_rad = phases
            .map(|(phase, line)| match ((line.value - phase) / TAU).round() {
                0.0 => *phase,
                turns => phase + TAU * turns,
            })
            .collect();
        Sighting {
            phases_rad,
            ..sighting.clone()
        }
    };
    let both = pulses.iter().zip(&estimate.poses);
    both.map(|(pulse, pose)| pulse.iter().map(|s| one(s, pose)).collect())
        .collect()
}

/// Number of phases with ambiguous whole turns in each pulse.
pub(crate) fn doubtful(
    array: &Array,
    pulses: &[Vec<Sighting>],
    numbers: &[usize],
    estimate: &Estimate,
) -> Vec<usize> {
    let poses = &estimate.poses;
    let one = |(n, pulse): (usize, &Vec<Sighting>)| {
        let even = even_pose(poses, numbers, n);
        let uneven = pulse.iter().map(|sighting| {
            let target = &estimate.targets[sighting.target];
            let lines = array.lines(&poses[n], target);
            let even = even.map(|(pose, factor)| (array.lines(&pose, target), factor));
            let is_uneven = |(c, phase): &(usize, &f64)| {
                let second = even.as_ref().map_or(0.0, |(even, factor)| {
                    factor * (lines[*c].value - even[*c].value)
                });
                let residual = *phase - lines[*c].value;
                second.abs().max(residual.abs()) > WRAPPED * PI
            };
            let phases = sighting.phases_rad.iter().enumerate();
            phases.filter(is_uneven).count()
        });
        let uneven: usize = uneven.sum();
        match uneven > 0 && ambiguity(array, pulse, &poses[n], estimate) < EXCLUDED {
            true => uneven,
            false => 0,
        }
    };
    let mut doubtful: Vec<usize> = pulses.iter().enumerate().map(one).collect();
    let misfits = misfits(array, pulses, estimate);
    if misfits.iter().filter(|count| **count > 0).count() > 1 + pulses.len() / MISFITS {
        let both = doubtful.iter_mut().zip(misfits);
        both.for_each(|(to, count)| *to = count.max(*to));
    }
    doubtful
}

/// Number of phases of each pulse that contradicts its pose, by RMS residuals above [`CONTRADICTS_RAD`] and three standard deviations; 0 for other pulses. A whole turn or a target is wrong there.
fn misfits(array: &Array, pulses: &[Vec<Sighting>], estimate: &Estimate) -> Vec<usize> {
    let of = |(pulse, pose): (&Vec<Sighting>, &Pose)| {
        let (mut square, mut variance, mut count) = (0.0, 0.0, 0);
        for sighting in pulse {
            let lines = array.lines(pose, &estimate.targets[sighting.target]);
            for (phase, line) in sighting.phases_rad.iter().zip(&lines) {
                square += (phase - line.value).powi(2);
                variance += sighting.phase_sigma_rad.powi(2);
                count += 1;
            }
        }
        let most = (CONTRADICTS_RAD * CONTRADICTS_RAD * f64::from(count)).max(9.0 * variance);
        if square > most { count as usize } else { 0 }
    };
    pulses.iter().zip(&estimate.poses).map(of).collect()
}

/// The pose at an even motion between the neighbours of pose `n`, and by how much the second difference exceeds the distance from there.
fn even_pose(poses: &[Pose], numbers: &[usize], n: usize) -> Option<(Pose, f64)> {
    let (before, after) = (poses.get(n.checked_sub(1)?)?, poses.get(n + 1)?);
    let [to, from] =
        [numbers[n] - numbers[n - 1], numbers[n + 1] - numbers[n]].map(|pulses| pulses as f64);
    let part = to / (to + from);
    let pose = Pose {
        at_m: before.at_m.lerp(after.at_m, part),
        heading_rad: before.heading_rad + part * (after.heading_rad - before.heading_rad),
    };
    Some((pose, 1.0 / part.min(1.0 - part)))
}

/// A target's part in another pose.
struct Part {
    /// Derivatives of its phases, summed with their weights, and its information on the pose by phases and by range.
    slope: DVec3,
    by_phases: DMat3,
    by_range: DMat3,
    /// Weight of a phase common to its channels.
    weight: f64,
}

impl Part {
    fn new(sighting: &Sighting, lines: &[Line]) -> Self {
        let outer = |line: &Line, sigma: f64| {
            let w = line.pose / (sigma * sigma);
            DMat3::from_cols(w * line.pose.x, w * line.pose.y, w * line.pose.z)
        };
        let sigma = sighting.phase_sigma_rad;
        let (range, phases) = lines.split_last().expect("a range follows the phases");
        let weight = 1.0 / (sigma * sigma);
        Self {
            slope: phases.iter().map(|line| line.pose * weight).sum(),
            by_phases: phases.iter().map(|line| outer(line, sigma)).sum(),
            by_range: outer(range, sighting.range_sigma_m),
            weight: weight * phases.len() as f64,
        }
    }
}

fn solved(mut matrix: DMat3, heading: Heading, right: DVec3) -> Option<DVec3> {
    if heading == Heading::Known {
        matrix.z_axis.z += HELD;
    }
    // Symmetric, so that rows are columns.
    let factor = Factor::new(3, &matrix.to_cols_array(), MIN_PIVOT)?;
    let mut step = right.to_array();
    factor.solve(&mut step);
    Some(DVec3::from_array(step))
}

/// Smallest `Q` over turns: up to one turn for each pair of targets, and the turns that follow for the others.
fn ambiguity(array: &Array, pulse: &[Sighting], pose: &Pose, estimate: &Estimate) -> f64 {
    let heading = estimate.heading;
    let part = |sighting: &Sighting| {
        let lines = array.lines(pose, &estimate.targets[sighting.target]);
        Part::new(sighting, &lines)
    };
    let parts: Vec<Part> = pulse.iter().map(part).collect();
    let all: DMat3 = parts
        .iter()
        .map(|part| part.by_phases + part.by_range)
        .sum();
    let cost = |turns: &[f64]| {
        let both = || parts.iter().zip(turns);
        let right: DVec3 = both().map(|(part, k)| part.slope * (TAU * k)).sum();
        let own: f64 = both()
            .map(|(part, k)| part.weight * (TAU * k).powi(2))
            .sum();
        solved(all, heading, right).map_or(0.0, |step| own - right.dot(step))
    };
    let mut least = f64::INFINITY;
    for (i, a) in parts.iter().enumerate() {
        for (j, b) in parts.iter().enumerate().skip(i + 1) {
            let matrix = a.by_phases + b.by_phases + all * OTHERS;
            // Turns of opposite sign have equal cost.
            for [of_a, of_b] in [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]] {
                let right = (a.slope * of_a + b.slope * of_b) * TAU;
                let Some(step) = solved(matrix, heading, right) else {
                    return 0.0;
                };
                let follows = |part: &Part| (part.slope.dot(step) / (part.weight * TAU)).round();
                let mut turns: Vec<f64> = parts.iter().map(follows).collect();
                (turns[i], turns[j]) = (of_a, of_b);
                least = least.min(cost(&turns));
            }
        }
    }
    least
}
