//! How fast a target moves, the radar's track being known: a place and a velocity that does not change, by least squares of phases and ranges.

use glam::{DMat2, DVec2};
use subaperture_signal::dense::Factor;

use crate::LEAST_PIVOT;
use crate::model::{Array, Pose};
use crate::series::{Series, line, unit};

/// Least-squares steps at most.
const MOST_STEPS: usize = 30;

/// A target that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// As it is called.
    pub target: usize,
    /// Where it is at the time 0, in the track's frame.
    pub at_m: DVec2,
    /// Metres a second.
    pub velocity_m_s: DVec2,
    /// Of the velocity.
    pub covariance: DMat2,
    /// The sum of squared errors in standard deviations, and how many numbers there are beyond those that are found: more than that if its velocity changes.
    pub chi_square: [f64; 2],
}

/// Numbers that a mover has: place, velocity and phase.
const UNKNOWNS: usize = 5;

/// A target's velocity, the radar's poses being known; none if it does not follow.
pub(crate) fn velocity(
    array: &Array,
    series: &Series,
    poses: &[Pose],
    times_s: &[f64],
) -> Option<Mover> {
    let k = array.rad_m();
    let looks = &series.looks;
    let place = |look: &crate::series::Look| {
        let pose = &poses[look.pulse];
        let from = unit(pose.heading_rad).rotate(look.arrival.at_m);
        (times_s[look.pulse], pose.at_m + from)
    };
    let [vx, _, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.x)));
    let [vy, _, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.y)));
    let count = looks.len() as f64;
    let mean_s = looks.iter().map(|look| place(look).0).sum::<f64>() / count;
    let mean_m = looks.iter().map(|look| place(look).1).sum::<DVec2>() / count;
    let mut velocity = DVec2::new(vx, vy);
    let mut at_m = mean_m;
    let mut phase = None;
    let mut last = None;
    for _ in 0..MOST_STEPS {
        let mut matrix = [0.0; UNKNOWNS * UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        let mut sum = 0.0;
        for look in looks {
            let pose = &poses[look.pulse];
            let t = times_s[look.pulse] - mean_s;
            let paths = array.paths(pose, at_m + velocity * t);
            let channels = paths.len() as f64;
            let mean_path_m = paths.iter().map(|path| path.length_m).sum::<f64>() / channels;
            let mean_slope = paths.iter().map(|path| path.slope).sum::<DVec2>() / channels;
            let phase = *phase.get_or_insert(look.common_rad + k * mean_path_m);
            let mut add = |error: f64, slope: DVec2, of_phase: f64, sigma: f64| {
                let row = [slope.x, slope.y, slope.x * t, slope.y * t, of_phase];
                let weight = 1.0 / (sigma * sigma);
                sum += error * error * weight;
                for i in 0..UNKNOWNS {
                    right[i] += weight * row[i] * error;
                    (0..UNKNOWNS)
                        .for_each(|j| matrix[i * UNKNOWNS + j] += weight * row[i] * row[j]);
                }
            };
            for (measured, path) in Series::phases_rad(look).iter().zip(&paths) {
                let error = measured - (phase - k * path.length_m);
                add(error, -k * path.slope, 1.0, look.sighting.phase_sigma_rad);
            }
            let error_m = look.sighting.range_m - 0.5 * mean_path_m;
            add(error_m, 0.5 * mean_slope, 0.0, look.sighting.range_sigma_m);
        }
        let factor = Factor::new(UNKNOWNS, &matrix, LEAST_PIVOT)?;
        let promised: f64 = {
            let mut step = right;
            factor.solve(&mut step);
            at_m += DVec2::new(step[0], step[1]);
            velocity += DVec2::new(step[2], step[3]);
            phase = phase.map(|phase| phase + step[4]);
            step.iter().zip(&right).map(|(a, b)| a * b).sum()
        };
        let inverse = factor.inverse();
        let of = |i: usize, j: usize| inverse[i * UNKNOWNS + j];
        let covariance = DMat2::from_cols_array(&[of(2, 2), of(2, 3), of(3, 2), of(3, 3)]);
        last = Some((sum - promised, covariance));
        if promised < 1e-5 {
            break;
        }
    }
    let (sum, covariance) = last?;
    let numbers = looks.len() * (array.num_channels() + 1);
    let mover = Mover {
        target: series.name,
        at_m: at_m - velocity * mean_s,
        velocity_m_s: velocity,
        covariance,
        chi_square: [sum, numbers.saturating_sub(UNKNOWNS) as f64],
    };
    (mover.at_m.is_finite() && velocity.is_finite()).then_some(mover)
}
