//! Amplitude gain of a scatterer: antenna patterns, spreading loss and occlusion.
//!
//! ```text
//! g = A_tx A_rx [R0^2 / (R_tx R_rx)] V
//! ```
//!
//! with the antenna amplitudes `A` towards the scatterer, the one-way ranges `R`, `R0^2` the product of both ranges to
//! the reference point at the middle pulse (number `P/2` of `P`, from 0), and the visibility `V`, 0 if a block lies
//! between the scatterer and either antenna. All are evaluated at one time, that of the pulse or, with intra-pulse
//! motion, the middle of the sweep. The change within a sweep is neglected, `v T / R` relative to the beamwidth (1e-4
//! for 125 m/s, 1 ms and 1 km). Corner reflectors are evaluated at the wavelength of the band's centre and, for
//! bistatic antennas, along the bisector.

use glam::{DQuat, DVec3};

use super::View;
use crate::scene::shadow::hidden;
use crate::scene::{Block, Corner};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{Antenna, Pattern};

/// Antennas of a view at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Illumination<'a> {
    view: &'a View<'a>,
    blocks: &'a [Block],
    attitude: DQuat,
    pub(super) transmitter_m: DVec3,
    pub(super) receiver_m: DVec3,
    wavelength_m: f64,
}

impl<'a> Illumination<'a> {
    pub(super) fn new(view: &'a View<'a>, blocks: &'a [Block]) -> Self {
        let pose = view.body.pose(view.middle_s());
        let sweep = &view.sweep;
        let centre_hz = sweep.start_hz + sweep.step_hz * (sweep.count.max(1) - 1) as f64 / 2.0;
        Self {
            view,
            blocks,
            attitude: pose.attitude,
            transmitter_m: pose.point_m(view.transmitter.offset_m),
            receiver_m: pose.point_m(view.receiver.offset_m),
            wavelength_m: SPEED_OF_LIGHT_M_S / centre_hz,
        }
    }

    /// Whether antenna gain and visibility are 1 for every point.
    pub(super) fn is_even(&self) -> bool {
        let even = |pattern: &Pattern| *pattern == Pattern::Isotropic;
        self.blocks.is_empty()
            && even(&self.view.transmitter.pattern)
            && even(&self.view.receiver.pattern)
    }

    /// Antenna gain and visibility of a point, without spreading loss.
    pub(super) fn beam(&self, point_m: DVec3) -> f64 {
        if self.is_even() {
            return 1.0;
        }
        let one =
            |antenna: &Antenna, from_m: DVec3| antenna.amplitude_at(self.attitude, from_m, point_m);
        let beam = one(self.view.transmitter, self.transmitter_m)
            * one(self.view.receiver, self.receiver_m);
        let same = self.transmitter_m == self.receiver_m;
        // Occlusion is the most costly, so it is tested only for illuminated points.
        if beam == 0.0
            || hidden(self.blocks, self.transmitter_m, point_m)
            || (!same && hidden(self.blocks, self.receiver_m, point_m))
        {
            return 0.0;
        }
        beam
    }

    /// Amplitude of a corner reflector.
    pub(super) fn corner(&self, corner: &Corner) -> f64 {
        let to = |antenna_m: DVec3| (antenna_m - corner.position_m).normalize_or_zero();
        let bisector = (to(self.transmitter_m) + to(self.receiver_m)).normalize_or_zero();
        corner.amplitude(bisector, self.wavelength_m)
    }

    /// Range at which the spreading factor is 1, metres; `None` without spreading loss.
    pub(super) fn spreading_from_m(&self) -> Option<f64> {
        self.view.spreading_from_m
    }

    /// Spreading factor of a point; 1 without spreading loss.
    pub(super) fn spreading(&self, point_m: DVec3) -> f64 {
        self.view.spreading_from_m.map_or(1.0, |from_m| {
            let out_m = self.transmitter_m.distance(point_m);
            let back_m = self.receiver_m.distance(point_m);
            from_m * from_m / (out_m * back_m)
        })
    }

    /// Total gain of a point: antennas, visibility and spreading.
    pub(super) fn of(&self, point_m: DVec3) -> f64 {
        self.beam(point_m) * self.spreading(point_m)
    }
}
