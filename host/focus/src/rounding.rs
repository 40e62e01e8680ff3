//! Arithmetic rounding errors, relative: the smallest error that a former may predict.

use std::f64::consts::TAU;

use super::ImageSpec;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

/// RMS rounding of a float32, relative: half a unit in the last place over the root of 3, averaged over
/// mantissas.
pub(super) const FLOAT32: f64 = 3e-8;

/// Largest rounding of a float32, relative: half a unit in the last place for a mantissa of 1.
pub(super) const LARGEST_FLOAT32: f64 = 6e-8;

/// RMS phase error, radians, of float64 paths from antenna and pixel positions: a few roundings of the
/// largest intermediate value.
pub(super) fn path_phase_rad(collection: &Collection, grid: &ImageGrid) -> f64 {
    let corners = [
        (0, 0),
        (0, grid.columns.count.saturating_sub(1)),
        (grid.rows.count.saturating_sub(1), 0),
    ];
    let scene_m = corners
        .map(|(row, column)| grid.position_m(row, column).length())
        .into_iter()
        .fold(0.0, f64::max);
    let last = collection.num_samples.saturating_sub(1);
    let turns = collection.pulses.iter().map(|pulse| {
        let paths_m = pulse.transmitter_m.length() + pulse.receiver_m.length() + 2.0 * scene_m;
        let highest_hz = pulse.start_hz.abs().max(pulse.frequency_hz(last).abs());
        (paths_m + pulse.reference_path_m.abs()) * highest_hz / SPEED_OF_LIGHT_M_S
    });
    TAU * turns.fold(0.0, f64::max) * f64::EPSILON
}

/// Upper bound on the RMS phase, radians, over the grid of the task, of the difference of pulse frequencies from the first pulse's, for a former that uses
/// one band.
pub(super) fn band_phase_rad(spec: &ImageSpec) -> f64 {
    let (collection, grid) = (spec.collection, spec.grid);
    let last = collection.num_samples.saturating_sub(1);
    let Some(first) = collection.pulses.first() else {
        return 0.0;
    };
    let corners = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(row, column)| {
        grid.position_m(
            row * (grid.rows.count - 1),
            column * (grid.columns.count - 1),
        )
    });
    let squares = collection.pulses.iter().map(|pulse| {
        let off = |k: usize| (pulse.frequency_hz(k) - first.frequency_hz(k)).abs();
        let off_hz = off(0).max(off(last));
        if off_hz == 0.0 {
            return 0.0;
        }
        let paths_m = corners.map(|point| pulse.relative_path_m(point).abs());
        let turns = off_hz * paths_m.into_iter().fold(0.0, f64::max) / SPEED_OF_LIGHT_M_S;
        (TAU * turns).powi(2)
    });
    (squares.sum::<f64>() / collection.pulses.len() as f64).sqrt()
}

/// Highest frequency of any sample, hertz.
pub(super) fn highest_hz(spec: &ImageSpec) -> f64 {
    let collection = spec.collection;
    let last = collection.num_samples.saturating_sub(1);
    let each = collection.pulses.iter();
    each.map(|p| p.start_hz.abs().max(p.frequency_hz(last).abs()))
        .fold(0.0, f64::max)
}

/// RMS rounding of a sequential sum of `terms` float32 values, relative to the sum: each partial
/// sum is rounded once, which is a third of the squared sum for one that grows evenly.
pub(super) fn sum(terms: usize) -> f64 {
    FLOAT32 * (1.0 + terms as f64 / 3.0).sqrt()
}

/// Root of summed squares, dB.
pub(super) fn total_db(errors: &[f64]) -> f64 {
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    10.0 * libm::log10(squares)
}
