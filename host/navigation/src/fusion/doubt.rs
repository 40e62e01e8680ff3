//! Increments that are far off from their neighbours.
//!
//! A phase that wrapped, or a target that was taken for another, moves the radar by a part of a wavelength within a pulse. Least squares over all would
//! believe that, as an increment is stated to micrometres and all the rest to millimetres; the vehicle's inertia tells. An increment is doubted if its velocity or
//! rate of turn is more than [`Model::doubted`] standard deviations from the median of up to [`REACH`] on either side: those of its own noise, of theirs, and of what the
//! [`Model`] has of accelerations within that time. It is left out, and the millisecond bridged, which costs micrometres.

use super::{Increment, Model};

/// Increments on either side.
const REACH: usize = 3;
/// With fewer than this of neighbours nothing is doubted.
const FEWEST: usize = 4;

/// Numbers of those that are doubted, ascending.
pub(super) fn doubted(increments: &[Increment], model: &Model) -> Vec<usize> {
    let Some(most) = model.doubted else {
        return Vec::new();
    };
    let rates = |one: &Increment| {
        let [x, y] = one.moved_m;
        [x, y, one.turned_rad].map(|moved| moved / (one.to_s - one.from_s))
    };
    let far = |n: usize| {
        let one = &increments[n];
        let dt = one.to_s - one.from_s;
        let around = n.saturating_sub(REACH)..(n + REACH + 1).min(increments.len());
        let near = |m: &usize| {
            let other = &increments[*m];
            *m != n && (other.from_s - one.from_s).abs() <= 1.5 * REACH as f64 * dt
        };
        let near: Vec<usize> = around.filter(near).collect();
        if near.len() < FEWEST {
            return false;
        }
        let own = rates(one);
        (0..3).any(|k| {
            let mut others: Vec<f64> = near.iter().map(|&m| rates(&increments[m])[k]).collect();
            others.sort_by(f64::total_cmp);
            let wander = if k < 2 {
                model.acceleration
            } else {
                model.turning
            };
            let noise = one.covariance.col(k)[k] / (dt * dt);
            let variance = 2.0 * noise + wander * wander * (2 * REACH) as f64 * dt;
            (own[k] - others[others.len() / 2]).abs() > most * variance.sqrt()
        })
    };
    (0..increments.len()).filter(|&n| far(n)).collect()
}
