//! Velocity of a moving target on a known track: position and constant velocity by least squares of phases and ranges.
//!
//! Phases are unwrapped within runs of pulses only: after a gap of more than [`MAX_GAP`] pulses the phase has a new unknown offset.

use glam::{DMat2, DVec2, DVec4};
use subaperture_signal::dense::Factor;

use super::classify::MIN_SEGMENT;
use crate::MIN_PIVOT;
use crate::model::{Array, Pose, Sighting};
use crate::series::{Look, Series, line, unit};

/// Largest number of steps.
const MAX_STEPS: usize = 30;
/// Largest gap, in pulses, over which the phase is unwrapped.
const MAX_GAP: usize = 3;

/// Moving target with its estimated velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// Number of the target.
    pub target: usize,
    /// Position at time 0 in the track's frame, metres.
    pub at_m: DVec2,
    /// Constant velocity in the track's frame, m/s.
    pub velocity_m_s: DVec2,
    /// Covariance of the velocity, (m/s)^2.
    pub covariance: DMat2,
    /// Sum of squared residuals in standard deviations, and its expectation: the sum exceeds it if the velocity changes.
    pub chi_square: [f64; 2],
    /// RMS residual of the phases, radians.
    pub phase_rms_rad: f64,
    /// Mean velocity from ranges and directions alone, whether it changes or not, m/s.
    pub mean_m_s: DVec2,
    /// Standard deviation of the mean velocity along either axis from the scatter of the positions, m/s.
    pub mean_sigma_m_s: f64,
    /// Position at the first sighting by the mean velocity, metres.
    pub first_m: DVec2,
    /// Times of the first and the last sighting, seconds.
    pub seen_s: [f64; 2],
    /// Number of pulses with a sighting.
    pub pulses: usize,
}

impl Mover {
    /// Position at a time for constant velocity, metres in the track's frame.
    pub fn place_m(&self, time_s: f64) -> DVec2 {
        self.at_m + self.velocity_m_s * time_s
    }

    /// Squared residuals over their expectation: about 1 for constant velocity.
    pub fn misfit(&self) -> f64 {
        self.chi_square[0] / self.chi_square[1].max(1.0)
    }

    /// Whether one velocity explains all sightings.
    pub fn is_steady(&self) -> bool {
        self.misfit() < STEADY || self.phase_rms_rad < STEADY_RAD
    }
}

/// Velocities of all targets in these pulses on a known track. Targets of fewer than 8 pulses, or whose velocity is not determined, are left out.
///
/// # Panics
/// If there are fewer poses or times than pulses.
pub fn velocities(
    array: &Array,
    pulses: &[Vec<Sighting>],
    poses: &[Pose],
    times_s: &[f64],
) -> Vec<Mover> {
    let all = Series::all(array, pulses);
    all.iter()
        .filter(|series| series.looks.len() >= MIN_SEGMENT)
        .filter_map(|series| velocity(array, series, poses, times_s))
        .collect()
}

/// Squared residuals over their expectation up to which a velocity is taken for constant.
const STEADY: f64 = 4.0;
/// The same for strong echoes, whose model errors exceed noise: RMS phase residual in radians, a fortieth of a wavelength of path.
const STEADY_RAD: f64 = 0.15;

/// Sums over the phases of a run of pulses with an unknown offset.
#[derive(Clone, Copy, Default)]
struct Run {
    weight: f64,
    row: DVec4,
    error: f64,
}

/// Number of unknowns: position and velocity in the plane.
const UNKNOWNS: usize = 4;

/// Velocity of a target on a known track; `None` if it is not determined.
pub(crate) fn velocity(
    array: &Array,
    series: &Series,
    poses: &[Pose],
    times_s: &[f64],
) -> Option<Mover> {
    let k = array.rad_m();
    let looks = &series.looks;
    let place = |look: &Look| {
        let pose = &poses[look.pulse];
        let from = unit(pose.heading_rad).rotate(look.arrival.at_m);
        (times_s[look.pulse], pose.at_m + from)
    };
    let [vx, slope_sigma, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.x)));
    let [vy, _, _] = line(looks.iter().map(|look| (place(look).0, place(look).1.y)));
    let count = looks.len() as f64;
    let mean_s = looks.iter().map(|look| place(look).0).sum::<f64>() / count;
    let mean_m = looks.iter().map(|look| place(look).1).sum::<DVec2>() / count;
    let mean_velocity = DVec2::new(vx, vy);
    let scatter = looks.iter().map(|look| {
        let (time_s, at_m) = place(look);
        at_m.distance_squared(mean_m + mean_velocity * (time_s - mean_s))
    });
    let scatter_m = libm::sqrt(0.5 * scatter.sum::<f64>() / count);
    let mut velocity = mean_velocity;
    let mut at_m = mean_m;
    let mut last = None;
    let mut runs = 0;
    for _ in 0..MAX_STEPS {
        let mut matrix = [0.0; UNKNOWNS * UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        let mut sum = 0.0;
        let mut add = |error: f64, row: DVec4, weight: f64| {
            sum += error * error * weight;
            let row = row.to_array();
            for i in 0..UNKNOWNS {
                right[i] += weight * row[i] * error;
                (0..UNKNOWNS).for_each(|j| matrix[i * UNKNOWNS + j] += weight * row[i] * row[j]);
            }
        };
        let (mut run, mut offset, mut before) = (Run::default(), 0.0, None);
        runs = 0;
        // The offset takes the mean of a run.
        let close = |run: Run, add: &mut dyn FnMut(f64, DVec4, f64)| {
            if run.weight > 0.0 {
                add(run.error / run.weight, run.row / run.weight, -run.weight);
            }
        };
        for look in looks {
            let pose = &poses[look.pulse];
            let t = times_s[look.pulse] - mean_s;
            let paths = array.paths(pose, at_m + velocity * t);
            let channels = paths.len() as f64;
            let mean_path_m = paths.iter().map(|path| path.length_m).sum::<f64>() / channels;
            let mean_slope = paths.iter().map(|path| path.slope).sum::<DVec2>() / channels;
            let row = |slope: DVec2| DVec4::new(slope.x, slope.y, slope.x * t, slope.y * t);
            if before.is_none_or(|before| look.pulse - before > MAX_GAP + 1) {
                close(std::mem::take(&mut run), &mut add);
                offset = look.common_rad + k * mean_path_m;
                runs += 1;
            }
            before = Some(look.pulse);
            for (measured, path) in Series::phases_rad(look).iter().zip(&paths) {
                let error = measured - (offset - k * path.length_m);
                let row = row(-k * path.slope);
                let weight = look.sighting.phase_sigma_rad.powi(-2);
                add(error, row, weight);
                run.weight += weight;
                run.row += row * weight;
                run.error += error * weight;
            }
            let error_m = look.sighting.range_m - 0.5 * mean_path_m;
            add(
                error_m,
                row(0.5 * mean_slope),
                look.sighting.range_sigma_m.powi(-2),
            );
        }
        close(run, &mut add);
        let factor = Factor::new(UNKNOWNS, &matrix, MIN_PIVOT)?;
        let predicted: f64 = {
            let mut step = right;
            factor.solve(&mut step);
            at_m += DVec2::new(step[0], step[1]);
            velocity += DVec2::new(step[2], step[3]);
            step.iter().zip(&right).map(|(a, b)| a * b).sum()
        };
        let inverse = factor.inverse();
        let of = |i: usize, j: usize| inverse[i * UNKNOWNS + j];
        let covariance = DMat2::from_cols_array(&[of(2, 2), of(2, 3), of(3, 2), of(3, 3)]);
        last = Some((sum - predicted, covariance));
        if predicted < 1e-5 {
            break;
        }
    }
    let (sum, covariance) = last?;
    let numbers = looks.len() * (array.num_channels() + 1);
    let free = numbers.saturating_sub(UNKNOWNS + runs).max(1) as f64;
    let noise = looks
        .iter()
        .map(|look| look.sighting.phase_sigma_rad.powi(2));
    let mover = Mover {
        phase_rms_rad: libm::sqrt(sum / free * noise.sum::<f64>() / count),
        target: series.name,
        at_m: at_m - velocity * mean_s,
        velocity_m_s: velocity,
        covariance,
        chi_square: [sum, free],
        mean_m_s: mean_velocity,
        mean_sigma_m_s: scatter_m * slope_sigma,
        first_m: mean_m + mean_velocity * (times_s[looks[0].pulse] - mean_s),
        seen_s: [&looks[0], &looks[looks.len() - 1]].map(|look| times_s[look.pulse]),
        pulses: looks.len(),
    };
    (mover.at_m.is_finite() && velocity.is_finite()).then_some(mover)
}
