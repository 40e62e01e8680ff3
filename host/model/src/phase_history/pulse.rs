//! Geometry and frequency axis of one pulse.

use glam::DVec3;

use super::sweep::Sweep;
use crate::SPEED_OF_LIGHT_M_S;

/// Geometry and frequency axis of one pulse. Positions in metres in the scene frame, at the time of sample `K/2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Time of the pulse, seconds from the collection's start.
    pub time_s: f64,
    /// Phase centre of the transmitting antenna.
    pub transmitter_m: DVec3,
    /// Phase centre of the receiving antenna.
    pub receiver_m: DVec3,
    /// Point to which the phase is compensated (CPHD's SRP).
    pub reference_m: DVec3,
    /// Two-way path length to which the phase is compensated, metres. Usually [`Pulse::path_m`] of `reference_m`, computed from
    /// the same stored positions, so that their rounding cancels in [`Self::relative_path_m`]. A path stored separately
    /// is rounded independently in each pulse, which adds phase noise.
    pub reference_path_m: f64,
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Frequency step from sample to sample, hertz; positive.
    pub step_hz: f64,
    /// Intra-pulse motion of the antennas.
    pub sweep: Sweep,
    /// Shortest and longest two-way path of the echoes that the samples contain completely, metres. `None` if not
    /// stated ([`Self::recorded_paths_m`]).
    pub recorded_path_m: Option<[f64; 2]>,
}

impl Pulse {
    /// Phase centre of the pair of antennas: the middle between transmitter and receiver, metres.
    #[inline]
    pub fn phase_centre_m(&self) -> DVec3 {
        self.transmitter_m.midpoint(self.receiver_m)
    }

    /// Two-way path from transmitter to `point` to receiver at the time of sample `K/2`, metres.
    #[inline]
    pub fn path_m(&self, point: DVec3) -> f64 {
        (point - self.transmitter_m).length() + (point - self.receiver_m).length()
    }

    /// Path to `point` relative to the reference path of the phase, metres.
    #[inline]
    pub fn relative_path_m(&self, point: DVec3) -> f64 {
        self.path_m(point) - self.reference_path_m
    }

    /// Two-way paths of the echoes that the samples contain completely, from and to, metres: the stated ones, otherwise
    /// the unambiguous interval of `c / step_hz` about the reference path. `None` for raw echoes (reference path 0)
    /// without a statement: the radar chooses their interval, by a range gate for example.
    pub fn recorded_paths_m(&self) -> Option<[f64; 2]> {
        let half_m = 0.5 * SPEED_OF_LIGHT_M_S / self.step_hz;
        let about_reference = [
            self.reference_path_m - half_m,
            self.reference_path_m + half_m,
        ];
        self.recorded_path_m
            .or((self.reference_path_m != 0.0).then_some(about_reference))
    }

    /// Frequency of sample `k`, hertz.
    #[inline]
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }
}
