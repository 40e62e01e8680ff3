//! Error of the stop-and-go approximation within a pulse: all samples are assigned one antenna position although the antennas move
//! between samples ([`subaperture_model::phase_history::Sweep`]).
//!
//! A scatterer at `p` then retains in sample `k` of pulse `n` the phase `2 pi f_k (r_nk(p) - r_n(p)) / c`, where `r` is the path
//! relative to the reference. A sample rotated by `phi` has the relative error `|1 - exp(j phi)|`, and the
//! image of a scatterer has the RMS of it over samples and pulses, including both range shift
//! and smear. The worst of points spread over the grid determines the error, since the
//! scatterer positions are unknown.
//!
//! Cost: negligible; at most 32 pulses, 25 points and 33 samples are evaluated.

use std::borrow::Borrow;
use std::f64::consts::PI;

use glam::DVec3;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

/// Largest number of sampled pulses.
const PULSES: usize = 32;

/// Largest number of evaluated samples.
const SAMPLES: usize = 33;

/// Relative RMS error of an image on `grid` by a former that assigns all samples of a pulse to the antenna position of sample
/// `K/2`; 0 without intra-pulse motion.
pub fn residual(collection: &Collection, grid: &ImageGrid) -> f64 {
    if !collection.sweeps() {
        return 0.0;
    }
    let pulses = spread_pulses(collection);
    let weights = vec![1.0; collection.num_samples];
    let pulses: Vec<(Pulse, &[f64])> = pulses.map(|pulse| (*pulse, &*weights)).collect();
    worst(&pulses, grid, |pulse, point, after| {
        let k = after + (collection.num_samples / 2) as f64;
        let frequency_hz = pulse.start_hz + k * pulse.step_hz;
        let drift_m = pulse.relative_path_after_m(point, after) - pulse.relative_path_m(point);
        frequency_hz * (drift_m / SPEED_OF_LIGHT_M_S)
    })
}

/// At most 32 pulses of a collection, evenly spread.
pub(super) fn spread_pulses(collection: &Collection) -> impl Iterator<Item = &Pulse> {
    spread(collection.pulses.len(), PULSES).map(|n| &collection.pulses[n])
}

/// Largest RMS error of any residual phase `left(pulse, point, after)` in turns, `after` samples after sample `K/2`, of pulses with the weights of
/// their `K` samples: the larger of the means with the weights, as in a point's peak, and with their squares, as in its whole response.
pub(super) fn worst<T: Borrow<Pulse>>(
    pulses: &[(T, &[f64])],
    grid: &ImageGrid,
    left: impl Fn(&T, DVec3, f64) -> f64,
) -> f64 {
    let mut worst = 0.0f64;
    for point in places(grid, 5) {
        let (mut sums, mut weights) = ([0.0; 2], [0.0; 2]);
        for (pulse, window) in pulses {
            let middle = (window.len() / 2) as f64;
            for k in spread(window.len(), SAMPLES) {
                // |1 - exp(j phi)| = 2 |sin(phi / 2)|
                let error = (2.0 * libm::sin(PI * left(pulse, point, k as f64 - middle))).powi(2);
                for (i, weight) in [window[k], window[k] * window[k]].into_iter().enumerate() {
                    sums[i] += weight * error;
                    weights[i] += weight;
                }
            }
        }
        for (sum, weight) in sums.into_iter().zip(weights) {
            worst = worst.max(sum / weight);
        }
    }
    worst.sqrt()
}

/// Evenly spread pixels of `grid` including its corners: at most `most` rows and columns.
pub(super) fn places(grid: &ImageGrid, most: usize) -> impl Iterator<Item = DVec3> {
    let columns = grid.columns.count;
    spread(grid.rows.count, most)
        .flat_map(move |row| spread(columns, most).map(move |column| (row, column)))
        .map(|(row, column)| grid.position_m(row, column))
}

/// At most `most` of `0..count`, including first and last.
fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let chosen = count.min(most);
    (0..chosen).map(move |i| match chosen {
        1 => 0,
        _ => i * (count - 1) / (chosen - 1),
    })
}
