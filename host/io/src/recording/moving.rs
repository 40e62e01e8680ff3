//! Echoes of a radar that moves during its sweeps.
//!
//! Sample `k` of a pulse at `t_n` is taken at `t = t_n + t_k - t_middle`; the time of a pulse is that of its middle sample. Its reference
//! path is `|T(t) - p| + |R(t) - p|` with `T` and `R` from the track, if phases are referred to a point. A track that is sampled at the
//! pulses only is a cubic spline between them, with an error of `5/384 h^4` of its fourth derivative, `h` the interval.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::pulses::Pulses;
use crate::receive::{EchoCollection, Echoes, StoredEchoes};
use subaperture_model::phase_history::ReadError;

/// Echoes in memory, and the trajectories of their antennas.
pub(super) struct InMotion<'a> {
    pub(super) held: StoredEchoes,
    /// Whether the radar moves during a sweep.
    pub(super) moves: bool,
    /// Reference point, if phases are referred to a point.
    pub(super) point: Option<DVec3>,
    pub(super) pulses: &'a Pulses,
    pub(super) bias_path_m: f64,
}

impl Echoes for InMotion<'_> {
    fn collection(&self) -> &EchoCollection {
        self.held.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.held.read(pulses, samples)
    }

    fn moves(&self) -> bool {
        self.moves
    }

    fn reference_path_m(&self, pulse: usize, after_s: f64) -> f64 {
        let Some(point_m) = self.point.filter(|_| self.moves) else {
            return self.held.reference_path_m(pulse, after_s);
        };
        let antennas_m = self.antennas_m(pulse, after_s);
        let path_m: f64 = antennas_m.iter().map(|a| a.distance(point_m)).sum();
        path_m + self.bias_path_m
    }

    fn antennas_m(&self, pulse: usize, after_s: f64) -> [DVec3; 2] {
        if !self.moves {
            return self.held.antennas_m(pulse, after_s);
        }
        let middle_s = self.collection().waveform.middle_s();
        let chosen = &self.pulses.chosen[pulse];
        let time_s = chosen.time_s + (after_s - middle_s);
        self.pulses.antennas.at_m(chosen.channel, time_s)
    }

    fn held_bytes(&self) -> u64 {
        self.held.held_bytes()
    }
}
