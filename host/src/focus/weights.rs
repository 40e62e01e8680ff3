//! Windows over fast and slow time, alike for every former.

use crate::phase_history::Collection;
use crate::signal::window::Window;

/// Weights of every frequency and every pulse of an aperture.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Weight of each frequency sample.
    pub fast: Vec<f64>,
    /// Weight of each pulse.
    pub slow: Vec<f64>,
}

impl Weights {
    /// Samples `fast` over the collection's frequencies and `slow` over its pulses by index.
    pub fn new(collection: &Collection, fast: Window, slow: Window) -> Self {
        Self {
            fast: fast.weights(collection.num_samples),
            slow: slow.weights(collection.pulses.len()),
        }
    }

    /// `1 / (sum fast * sum slow)`: the factor that makes a unit scatterer read 1.
    pub fn normalisation(&self) -> f64 {
        1.0 / (self.fast.iter().sum::<f64>() * self.slow.iter().sum::<f64>())
    }
}
