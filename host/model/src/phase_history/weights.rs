//! Fast-time and slow-time windows shared by all formers.

use std::sync::Arc;

use crate::phase_history::{BlockIllumination, Collection, Pulse, is_one_pass, ranks_by_angle};
use subaperture_signal::window::Window;

/// Window weights of the frequencies and pulses of an aperture.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Weight of each frequency sample.
    pub fast: Vec<f64>,
    /// Weight of each pulse.
    pub slow: Vec<f64>,
    /// Pulses and weights of each block of pixels, used instead of `slow` where the beam limits the pulses of a pixel.
    pub lit: Option<Arc<BlockIllumination>>,
    /// Windows over fast and slow time that the weights sample; `None` for other weights. A stored plan states its weights by them.
    pub windows: Option<[Window; 2]>,
}

impl Weights {
    /// Samples `fast` over the collection's frequencies and `slow` over its pulses, in their order: that of time, or where no time is known that in
    /// which they were recorded. So a recording has the same weights with times and without.
    ///
    /// Pulses of several passes without times, joined, have no common order. They are weighed in the order of the angle under which
    /// the antennas go around what they refer to, so that passes over the same angles share the window. A pass ends where the antennas
    /// jump by more than 8 usual steps, other than straight ahead. Pulses that are not in the order of any track are weighed so too.
    ///
    /// Channels one after another ([`Collection::num_turns`]) are weighed alike, each
    /// by `slow` over its own pulses.
    ///
    /// A window over time shapes the response across range if the antennas pass each place once. On a
    /// track that goes there and back it weighs the way there by its first half and the way back by its second.
    pub fn new(collection: &Collection, fast: Window, slow: Window) -> Self {
        let turns = collection.num_turns();
        let by_place = slow.weights(turns);
        let channels = collection.pulses.chunks(turns.max(1));
        let of_channel = |pulses: &[Pulse]| {
            let ranks = match collection.timed || is_one_pass(pulses) {
                true => None,
                false => ranks_by_angle(pulses),
            };
            match ranks {
                Some(ranks) => ranks.into_iter().map(|rank| by_place[rank]).collect(),
                None => by_place.clone(),
            }
        };
        Self {
            fast: fast.weights(collection.num_samples),
            slow: channels.flat_map(of_channel).collect(),
            lit: None,
            windows: Some([fast, slow]),
        }
    }

    /// `1 / (sum fast * sum slow)`: the factor that makes a unit scatterer read 1.
    pub fn normalisation(&self) -> f64 {
        1.0 / (self.fast.iter().sum::<f64>() * self.slow.iter().sum::<f64>())
    }

    /// The same of the pixel at a row and column; 0 where no pulse sees it.
    pub fn normalisation_at(&self, row: usize, column: usize) -> f64 {
        let Some(lit) = &self.lit else {
            return self.normalisation();
        };
        match lit.slow(lit.block_of(row, column)).1 {
            0.0 => 0.0,
            sum => 1.0 / (self.fast.iter().sum::<f64>() * sum),
        }
    }
}
