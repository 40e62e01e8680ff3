//! What a former errs by that takes all samples of a pulse at one place, while the antennas moved from one to the
//! next ([`subaperture_model::phase_history::Sweep`]).
//!
//! A scatterer at `p` then keeps in sample `k` of pulse `n` the phase `2 pi f_k (r_nk(p) - r_n(p)) / c`, `r` the path
//! relative to the reference's. What turns a sample by `phi` errs by `|1 - exp(j phi)|` of it, and the
//! image of a scatterer by the root of its mean square over samples and pulses, whatever part of that is a shift in range
//! and what a blur. The worst of places spread over the grid counts, for nobody knows where the
//! scatterers are.
//!
//! Cost: next to nothing; at most 32 pulses, 25 places and 33 samples are looked at.

use std::f64::consts::PI;

use glam::DVec3;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

/// Pulses looked at, at most.
const PULSES: usize = 32;

/// Samples looked at, at most.
const SAMPLES: usize = 33;

/// Relative RMS error of an image on `grid` by a former that takes all samples of a pulse at the place of sample
/// `K/2`; 0 if nothing moves meanwhile.
pub fn residual(collection: &Collection, grid: &ImageGrid) -> f64 {
    if !collection.sweeps() {
        return 0.0;
    }
    worst(collection, grid, |pulse, point, after| {
        let k = after + (collection.num_samples / 2) as f64;
        let frequency_hz = pulse.start_hz + k * pulse.step_hz;
        let drift_m = pulse.relative_path_after_m(point, after) - pulse.relative_path_m(point);
        frequency_hz * (drift_m / SPEED_OF_LIGHT_M_S)
    })
}

/// The same of any phase that is left: `left(pulse, point, after)` in turns, `after` samples after sample `K/2`.
pub(super) fn worst(
    collection: &Collection,
    grid: &ImageGrid,
    left: impl Fn(&Pulse, DVec3, f64) -> f64,
) -> f64 {
    let pulses: Vec<&Pulse> = spread(collection.pulses.len(), PULSES)
        .map(|n| &collection.pulses[n])
        .collect();
    let middle = (collection.num_samples / 2) as f64;
    let afters: Vec<f64> = spread(collection.num_samples, SAMPLES)
        .map(|k| k as f64 - middle)
        .collect();
    let mut worst = 0.0f64;
    for point in places(grid, 5) {
        let mut sum = 0.0;
        for pulse in &pulses {
            for &after in &afters {
                // |1 - exp(j phi)| = 2 |sin(phi / 2)|
                sum += (2.0 * libm::sin(PI * left(pulse, point, after))).powi(2);
            }
        }
        worst = worst.max(sum / (pulses.len() * afters.len()) as f64);
    }
    worst.sqrt()
}

/// Pixels of `grid`, evenly spread, its corners among them: at most `most` rows and columns.
pub(super) fn places(grid: &ImageGrid, most: usize) -> impl Iterator<Item = DVec3> {
    let columns = grid.columns.count;
    spread(grid.rows.count, most)
        .flat_map(move |row| spread(columns, most).map(move |column| (row, column)))
        .map(|(row, column)| grid.position_m(row, column))
}

/// At most `most` of `0..count`, first and last among them.
fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let chosen = count.min(most);
    (0..chosen).map(move |i| match chosen {
        1 => 0,
        _ => i * (count - 1) / (chosen - 1),
    })
}
