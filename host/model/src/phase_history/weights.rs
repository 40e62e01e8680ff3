//! Windows over fast and slow time, alike for every former.

use crate::phase_history::{Collection, Pulse, ranks_by_angle};
use subaperture_signal::window::Window;

/// Weights of every frequency and every pulse of an aperture.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Weight of each frequency sample.
    pub fast: Vec<f64>,
    /// Weight of each pulse.
    pub slow: Vec<f64>,
}

impl Weights {
    /// Samples `fast` over the collection's frequencies and `slow` over its pulses: in the order of time, which is
    /// that of the pulses, or where no time is known in that of the angle under which the antennas go around
    /// what they refer to. Channels one after another ([`Collection::num_turns`]) are weighed alike, each
    /// by `slow` over its own pulses.
    ///
    /// A window over time shapes the response across range if the antennas pass each place once. On a
    /// track that goes there and back it weighs the way there by its first half and the way back by its second.
    pub fn new(collection: &Collection, fast: Window, slow: Window) -> Self {
        let turns = collection.num_turns();
        let by_place = slow.weights(turns);
        let channels = collection.pulses.chunks(turns.max(1));
        let of_channel = |pulses: &[Pulse]| {
            let ranks = match collection.timed {
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
        }
    }

    /// `1 / (sum fast * sum slow)`: the factor that makes a unit scatterer read 1.
    pub fn normalisation(&self) -> f64 {
        1.0 / (self.fast.iter().sum::<f64>() * self.slow.iter().sum::<f64>())
    }
}
