//! Where and how a former's error is looked at before it begins.

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;

/// Points a side of the grid.
const SIDE: usize = 9;

/// Pixels spread over the grid, its corners and the middles of its edges among them: [`SIDE`] by [`SIDE`], fewer where
/// there are fewer.
pub(super) fn probes(grid: &ImageGrid) -> Vec<DVec3> {
    spread(grid, SIDE)
}

/// The same, `side` by `side`.
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

/// `|exp(j phase) - 1|^2`.
pub(super) fn turned(phase_rad: f64) -> f64 {
    4.0 * libm::sin(phase_rad / 2.0).powi(2)
}

/// Weights as shares of their sum, and of the sum of their squares: a point's peak counts samples by the one, all of
/// its response by the other.
pub(super) struct Shares(pub(super) Vec<[f64; 2]>);

impl Shares {
    pub(super) fn new(weights: &[f64]) -> Self {
        let sum: f64 = weights.iter().sum();
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        Self(weights.iter().map(|w| [w / sum, w * w / squares]).collect())
    }

    /// The larger of both means of `values`.
    pub(super) fn worst(&self, values: impl Iterator<Item = f64>) -> f64 {
        let mut means = [0.0; 2];
        for (share, value) in self.0.iter().zip(values) {
            means[0] += share[0] * value;
            means[1] += share[1] * value;
        }
        means[0].max(means[1])
    }
}
