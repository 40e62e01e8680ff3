//! Sampling points and statistics for error prediction.

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;

/// Points per side of the grid.
const SIDE: usize = 9;

/// Pixels spread over the grid including its corners and the midpoints of its edges: [`SIDE`] by [`SIDE`], or fewer on small
/// grids.
pub(super) fn probes(grid: &ImageGrid) -> Vec<DVec3> {
    spread(grid, SIDE)
}

/// Pixels spread over the grid, `side` by `side`.
pub(super) fn spread(grid: &ImageGrid, side: usize) -> Vec<DVec3> {
    let places = |count: usize| {
        let last = count.saturating_sub(1);
        let mut all: Vec<usize> = (0..side).map(|i| i * last / (side - 1)).collect();
        all.dedup();
        all
    };
    let columns = places(grid.columns.count);
    let rows = places(grid.rows.count).into_iter();
    rows.flat_map(|row| {
        columns
            .iter()
            .map(move |&column| grid.position_m(row, column))
    })
    .collect()
}

/// Squared error of a phase rotation, `|exp(j phase) - 1|^2`.
pub(super) fn turned(phase_rad: f64) -> f64 {
    4.0 * libm::sin(phase_rad / 2.0).powi(2)
}

/// Deviation of `values` from their running mean over an eighth of them; towards the ends the window shrinks symmetrically. Such fast variation
/// makes echoes away from a scatterer, whereas slow errors defocus it.
pub(super) fn rough(values: &[f64]) -> impl Iterator<Item = f64> {
    let count = values.len();
    let mut sums = Vec::with_capacity(count + 1);
    sums.push(0.0);
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let most = (count / 16).max(1);
    values.iter().enumerate().map(move |(i, value)| {
        let half = most.min(i).min(count - 1 - i);
        value - (sums[i + half + 1] - sums[i - half]) / (2 * half + 1) as f64
    })
}

/// Weights as fractions of their sum, and of the sum of their squares: the first weigh samples in a point's peak, the second in
/// its whole response.
pub(super) struct Shares(pub(super) Vec<[f64; 2]>);

impl Shares {
    pub(super) fn new(weights: &[f64]) -> Self {
        let sum: f64 = weights.iter().sum();
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        Self(weights.iter().map(|w| [w / sum, w * w / squares]).collect())
    }

    /// Larger of both weighted means of `values`.
    pub(super) fn worst(&self, values: impl Iterator<Item = f64>) -> f64 {
        let mut means = [0.0; 2];
        for (share, value) in self.0.iter().zip(values) {
            means[0] += share[0] * value;
            means[1] += share[1] * value;
        }
        means[0].max(means[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For `x^2` on -1 to 1, with `h` an eighth of a half, at most `h^2 / 3`; a wave with a period of three samples is nearly removed.
    #[test]
    fn slow_errors_are_not_rough() {
        let place = |i: i32| f64::from(i - 200) / 200.0;
        let slow: Vec<f64> = (0..401).map(|i| place(i).powi(2)).collect();
        let most = rough(&slow).fold(0.0f64, |most, x| most.max(x.abs()));
        assert!(most < 1.05 * 0.125f64.powi(2) / 3.0, "{most}");
        let fast: Vec<f64> = (0..402).map(|i| f64::from(i % 3) - 1.0).collect();
        let left: Vec<f64> = rough(&fast).collect();
        for i in 50..350 {
            assert!((left[i] - fast[i]).abs() < 0.05);
        }
    }
}
