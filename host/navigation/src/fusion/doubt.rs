//! Detection of outliers among increments.
//!
//! A phase slip or a mistaken target appears as motion by a fraction of a wavelength within a pulse. Least squares would accept it, as the standard deviations of increments are micrometres and those of other
//! measurements millimetres; the inertia of the vehicle excludes it. An increment is an outlier if its velocity or rate of turn is more than [`Model::outlier_sigmas`] standard deviations from the median of up to [`REACH`] neighbours on
//! either side. The standard deviation combines its own noise, that of the neighbours, and the [`Model`]'s accelerations within that time. Outliers are left out, and the gap of milliseconds is bridged at a cost of micrometres.

use super::{Increment, Model};

/// Neighbours on either side.
const REACH: usize = 3;
/// With fewer neighbours no outlier is declared.
const MIN_NEIGHBOURS: usize = 4;

/// Indices of the outliers, ascending.
pub(super) fn outliers(increments: &[Increment], model: &Model) -> Vec<usize> {
    let Some(most) = model.outlier_sigmas else {
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
        if near.len() < MIN_NEIGHBOURS {
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
