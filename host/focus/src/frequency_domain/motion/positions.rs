//! Along-track positions of pulses on the fitted line.

use glam::DVec3;
use subaperture_model::phase_history::Pulse;

use crate::straight_track::StraightTrack;

/// Positions of the pulses on the fitted line.
pub(in crate::frequency_domain) struct Positions {
    pub(in crate::frequency_domain) track: StraightTrack,
    /// Along-track pulse positions from the line's centre, metres; `None` for even positions.
    along_m: Option<Vec<f64>>,
    /// First and last along-track pulse position, metres.
    span_m: [f64; 2],
}

impl Positions {
    /// Even positions along `track`.
    pub(super) fn even(track: StraightTrack) -> Self {
        Self {
            span_m: [0, track.num_pulses - 1].map(|n| track.along_m(n)),
            track,
            along_m: None,
        }
    }

    /// Positions of recorded pulses along `track`.
    pub(super) fn recorded(track: StraightTrack, pulses: &[Pulse]) -> Self {
        let along_m: Vec<f64> = pulses.iter().map(|pulse| track.place_m(pulse)).collect();
        let low = along_m.iter().copied().fold(f64::INFINITY, f64::min);
        let high = along_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            track,
            along_m: Some(along_m),
            span_m: [low, high],
        }
    }

    /// Along-track position of pulse `n` from the line's centre, metres.
    pub(in crate::frequency_domain) fn along_m(&self, n: usize) -> f64 {
        match &self.along_m {
            Some(along_m) => along_m[n],
            None => self.track.along_m(n),
        }
    }

    /// First and last along-track pulse position, metres.
    pub(in crate::frequency_domain) fn span_m(&self) -> [f64; 2] {
        self.span_m
    }

    /// Range `rho` from pulse `n` on the line to a point of the scene, metres.
    pub(super) fn range_m(&self, n: usize, point: DVec3) -> f64 {
        let on_line = self.track.centre_m + self.track.direction * self.along_m(n);
        (point - on_line).length()
    }

    /// Whether pulses have individual along-track positions.
    pub(in crate::frequency_domain) fn is_uneven(&self) -> bool {
        self.along_m.is_some()
    }
}
