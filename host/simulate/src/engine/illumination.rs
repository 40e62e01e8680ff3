//! Amplitude gain of a scatterer: antenna patterns, spreading loss and occlusion.
//!
//! ```text
//! g = A_tx A_rx [R0^2 / (R_tx R_rx)] V
//! ```
//!
//! with the antenna amplitudes `A` towards the scatterer, the one-way ranges `R`, `R0^2` the product of both ranges to
//! the reference point at the middle pulse (number `P/2` of `P`, from 0), and the visibility `V`, 0 if a block or the terrain lies
//! between the scatterer and either antenna, otherwise the transmission of the foliage between it and both antennas. All are evaluated at one time, that of the pulse or, with intra-pulse
//! motion, the middle of the sweep. The change within a sweep is neglected, `v T / R` relative to the beamwidth (1e-4
//! for 125 m/s, 1 ms and 1 km). Corner reflectors are evaluated at the wavelength of the band's centre and, for
//! bistatic antennas, along the bisector; so are facets.

use glam::{DQuat, DVec3};

use super::View;
use super::obstacles::Obstacles;
use crate::scene::{Corner, Facet, MovingPoint, Scene, Shade};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{Antenna, Pattern};

/// Antennas of a view at one time.
#[derive(Clone, Debug)]
pub(super) struct Illumination<'a> {
    view: &'a View<'a>,
    obstacles: Obstacles,
    shade: Option<Shade<'a>>,
    attitude: DQuat,
    pub(super) transmitter_m: DVec3,
    pub(super) receiver_m: DVec3,
    wavelength_m: f64,
}

impl<'a> Illumination<'a> {
    /// Antennas with the obstacles of a scene.
    pub(super) fn new(view: &'a View<'a>, scene: &'a Scene) -> Self {
        let time_s = view.middle_s();
        let shadow = scene.terrain_shadow.as_deref();
        Self {
            obstacles: Obstacles::of(scene, time_s),
            shade: shadow.map(|shadow| shadow.at(time_s)),
            ..Self::open(view)
        }
    }

    /// Antennas of a scene without obstacles.
    pub(super) fn open(view: &'a View<'a>) -> Self {
        let pose = view.body.pose(view.middle_s());
        let sweep = &view.sweep;
        let centre_hz = sweep.start_hz + sweep.step_hz * (sweep.count.max(1) - 1) as f64 / 2.0;
        Self {
            view,
            obstacles: Obstacles::default(),
            shade: None,
            attitude: pose.attitude,
            transmitter_m: pose.point_m(view.transmitter.offset_m),
            receiver_m: pose.point_m(view.receiver.offset_m),
            wavelength_m: SPEED_OF_LIGHT_M_S / centre_hz,
        }
    }

    /// Whether antenna gain and visibility are 1 for every point.
    pub(super) fn is_even(&self) -> bool {
        self.obstacles.is_empty() && self.shade.is_none() && self.is_isotropic()
    }

    fn is_isotropic(&self) -> bool {
        let even = |pattern: &Pattern| *pattern == Pattern::Isotropic;
        even(&self.view.transmitter.pattern) && even(&self.view.receiver.pattern)
    }

    /// Obstacles that may affect points within a distance of `centre_m`.
    pub(super) fn obstacles_before(&self, centre_m: DVec3, radius_m: f64) -> Obstacles {
        let antennas_m = [self.transmitter_m, self.receiver_m];
        self.obstacles.before(antennas_m, centre_m, radius_m)
    }

    /// Antenna gain and visibility of a point, without spreading loss.
    pub(super) fn beam(&self, point_m: DVec3) -> f64 {
        self.beam_past(point_m, &self.obstacles)
    }

    /// [`Self::beam`], with the obstacles of its surroundings.
    pub(super) fn beam_past(&self, point_m: DVec3, obstacles: &Obstacles) -> f64 {
        if self.shade.is_some_and(|shade| shade.hides(point_m)) {
            return 0.0;
        }
        let one =
            |antenna: &Antenna, from_m: DVec3| antenna.amplitude_at(self.attitude, from_m, point_m);
        let beam = match self.is_isotropic() {
            true => 1.0,
            false => {
                one(self.view.transmitter, self.transmitter_m)
                    * one(self.view.receiver, self.receiver_m)
            }
        };
        // Occlusion is the most costly, so it is tested only for illuminated points.
        match beam == 0.0 || obstacles.is_empty() {
            true => beam,
            false => beam * obstacles.transmission([self.transmitter_m, self.receiver_m], point_m),
        }
    }

    /// Amplitude of a corner reflector.
    pub(super) fn corner(&self, corner: &Corner) -> f64 {
        corner.amplitude(self.bisector(corner.position_m), self.wavelength_m)
    }

    /// Facet as a point with the amplitude towards the antennas.
    pub(super) fn facet(&self, facet: &Facet) -> MovingPoint {
        facet.towards(self.bisector(facet.position_m(self.view.middle_s())))
    }

    /// Direction from a point between the antennas.
    fn bisector(&self, point_m: DVec3) -> DVec3 {
        let to = |antenna_m: DVec3| (antenna_m - point_m).normalize_or_zero();
        (to(self.transmitter_m) + to(self.receiver_m)).normalize_or_zero()
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
