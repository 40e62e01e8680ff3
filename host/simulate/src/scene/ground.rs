//! Ground under the objects of a scene.

use glam::{DVec2, DVec3};

use super::terrain::Terrain;

/// Ground, and the radar's position at the middle of the collection, from which its angle of incidence is taken.
///
/// The angle is constant over the collection: for an aperture of the angle `a` it is off by up to `a / 2` at its ends.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ground<'a> {
    /// Heights; `None` for the plane `z = 0`.
    pub terrain: Option<&'a Terrain>,
    /// Position of the radar, metres in the scene frame.
    pub radar_m: DVec3,
}

impl Ground<'_> {
    /// Point with its height above the ground replaced by its z.
    pub fn raise(&self, point_m: DVec3) -> DVec3 {
        match self.terrain {
            Some(terrain) => point_m + DVec3::Z * terrain.height_m(point_m.truncate()),
            None => point_m,
        }
    }

    /// Unit normal of the ground, upwards.
    pub fn normal(&self, at: DVec2) -> DVec3 {
        self.terrain.map_or(DVec3::Z, |terrain| terrain.normal(at))
    }

    /// Angle of incidence of the radar's line of sight to a point, from the normal of the ground below it, radians.
    pub fn incidence_rad(&self, point_m: DVec3) -> f64 {
        let towards = (self.radar_m - point_m).normalize_or_zero();
        libm::acos(
            self.normal(point_m.truncate())
                .dot(towards)
                .clamp(-1.0, 1.0),
        )
    }
}
