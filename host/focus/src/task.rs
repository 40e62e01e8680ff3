//! Image formation task.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{PhaseHistory, Weights};

use super::numerics::Numerics;
use super::spec::{ImageSpec, Work};

/// Image formation task.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Phase history of the recording.
    pub history: &'a dyn PhaseHistory,
    /// Pixel grid of the image.
    pub grid: &'a ImageGrid,
    /// Windows over fast and slow time.
    pub weights: &'a Weights,
    /// Transforms and timing model.
    pub numerics: Numerics<'a>,
    /// Memory limit for image, pulses being read and all scratch, bytes.
    pub memory_bytes: u64,
    /// Receiver of progress and source of cancellation.
    pub monitor: &'a dyn Monitor,
}

impl<'a> Task<'a> {
    /// Task with at most 1 GiB of memory, default [`Numerics`] and no report of progress.
    pub fn new(history: &'a dyn PhaseHistory, grid: &'a ImageGrid, weights: &'a Weights) -> Self {
        Self {
            history,
            grid,
            weights,
            numerics: Numerics::default(),
            memory_bytes: 1 << 30,
            monitor: &Silent,
        }
    }

    /// Specification of the image.
    pub fn spec(&self) -> ImageSpec<'a> {
        ImageSpec {
            numerics: self.numerics,
            ..ImageSpec::new(self.history.collection(), self.grid, self.weights)
        }
    }

    /// Source of the pulses, with limits.
    pub fn work(&self) -> Work<'a> {
        Work {
            history: self.history,
            memory_bytes: self.memory_bytes,
            monitor: self.monitor,
        }
    }
}
