//! Random targets of known motion.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex64;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

use crate::error::GmtiError;
use crate::motion::axes;
use crate::space_time::Motion;

/// Part of the extent of the grid, about its middle, in which targets are placed.
const PLACED: f64 = 0.9;

/// Target of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestTarget {
    /// Motion, horizontal and along the line of sight.
    pub motion: Motion,
    /// Radial velocity at the epoch, metres per second, positive when approaching.
    pub radial_velocity_m_s: f64,
    /// Amplitude, square root of the radar cross-section in m^2.
    pub amplitude: Complex64,
}

/// Draw `count` targets on a grid, apart in range. Their radial speeds are log-uniform over `speeds_m_s` with random sign, their amplitudes complex Gaussian with the mean
/// radar cross-section in m^2. `uniform` returns numbers from 0, included, to 1.
///
/// # Errors
/// [`GmtiError::Track`] for a recording without pulses or a vertical line of sight.
pub(super) fn draw(
    collection: &Collection,
    grid: &ImageGrid,
    count: usize,
    [slowest_m_s, fastest_m_s]: [f64; 2],
    cross_section_m2: f64,
    mut uniform: impl FnMut() -> f64,
) -> Result<Vec<TestTarget>, GmtiError> {
    let pulses = &collection.pulses;
    let (Some(first), Some(last)) = (pulses.first(), pulses.last()) else {
        return Err(GmtiError::Track("the recording has no pulses"));
    };
    let middle = &pulses[pulses.len() / 2];
    let along = last.phase_centre_m() - first.phase_centre_m();
    let mut target = |i: usize| {
        // One place in each stripe of the axis along the line of sight.
        let stripe = (i as f64 + uniform()) / count as f64;
        let part = |u: f64| 0.5 + PLACED * (u - 0.5);
        let position_m = of_grid(grid, [part(uniform()), part(stripe)], along);
        let speed_m_s = slowest_m_s * (fastest_m_s / slowest_m_s).powf(uniform());
        let velocity_m_s = speed_m_s.copysign(uniform() - 0.5);
        let sight = position_m - middle.phase_centre_m();
        let [_, away] = axes(sight, along)?;
        let power = -cross_section_m2 * libm::log(1.0 - uniform());
        Some(TestTarget {
            motion: Motion {
                epoch_s: middle.time_s,
                position_m,
                velocity_m_s: away * (-velocity_m_s / away.dot(sight.normalize_or_zero())),
                acceleration_m_s2: DVec3::ZERO,
            },
            radial_velocity_m_s: velocity_m_s,
            amplitude: Complex64::from_polar(power.sqrt(), TAU * uniform()),
        })
    };
    let targets: Option<Vec<TestTarget>> = (0..count).map(&mut target).collect();
    targets.ok_or(GmtiError::Track("the line of sight is vertical"))
}

/// Position at fractions of the extent of the grid along the track and across it.
fn of_grid(grid: &ImageGrid, [along, across]: [f64; 2], track: DVec3) -> DVec3 {
    let ends = [grid.rows.count, grid.columns.count].map(|count| count - 1);
    let [origin, rows, columns] =
        [[0, 0], [ends[0], 0], [0, ends[1]]].map(|[r, c]| grid.position_m(r, c));
    let [rows, columns] = [rows - origin, columns - origin];
    let slope = |axis: DVec3| {
        axis.normalize_or_zero()
            .dot(track.normalize_or_zero())
            .abs()
    };
    match slope(rows) > slope(columns) {
        true => origin + rows * along + columns * across,
        false => origin + columns * along + rows * across,
    }
}
