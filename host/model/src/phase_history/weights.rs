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
    pub illumination: Option<Arc<BlockIllumination>>,
    /// Windows over fast and slow time from which the weights were computed; `None` for other weights. A stored plan
    /// states its weights by them.
    pub windows: Option<[Window; 2]>,
}

impl Weights {
    /// Sample `fast` over the collection's frequencies and `slow` over its pulses in their order: that of time, or
    /// without times the recorded one. A recording has the same weights with and without times.
    ///
    /// Joined pulses of several passes without times have no common order. They are weighted in the order of the
    /// angle of the antennas around their reference points, so that passes over the same angles share the window. A
    /// pass ends at a jump of the antennas by more than 8 usual steps, other than straight ahead. Pulses that are not
    /// in the order of any track are weighted in the same order.
    ///
    /// Channels one after another ([`Collection::num_turns`]) have equal weights, each by `slow` over its own pulses.
    ///
    /// A window over time shapes the cross-range response if the antennas pass each position once. On a
    /// forth-and-back track its first half weights the outward pass and its second half the return.
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
            illumination: None,
            windows: Some([fast, slow]),
        }
    }

    /// `1 / (sum fast * sum slow)`: the factor with which a unit scatterer has the value 1.
    pub fn normalisation(&self) -> f64 {
        1.0 / (self.fast.iter().sum::<f64>() * self.slow.iter().sum::<f64>())
    }

    /// [`Self::normalisation`] of a pixel; 0 if no pulse illuminates it.
    pub fn normalisation_at(&self, row: usize, column: usize) -> f64 {
        let Some(illumination) = &self.illumination else {
            return self.normalisation();
        };
        let (slow, sum) = illumination.slow(illumination.block_of(row, column));
        match sum {
            0.0 => 0.0,
            sum => illumination.gain(&slow, row, column) / (self.fast.iter().sum::<f64>() * sum),
        }
    }
}
