//! Map projections: which place of the Earth a map's coordinates are.

use subaperture_model::geometry::{Geodetic, Utm, Zone};

use crate::MapError;

/// A projection, on WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Easting and northing of a zone, metres.
    Utm(Zone),
    /// Longitude and latitude, degrees (EPSG:4326), the former within half a turn of a meridian, so that a map may lie
    /// across the antimeridian.
    Geographic {
        /// That meridian, degrees.
        near_deg: f64,
    },
}

impl Projection {
    /// The zone in which a place lies.
    ///
    /// # Errors
    /// [`MapError::Utm`] near the poles.
    pub fn utm(place: &Geodetic) -> Result<Self, MapError> {
        Ok(Self::Utm(Zone::of(place)?))
    }

    /// Longitude and latitude around a place.
    pub fn geographic(place: &Geodetic) -> Self {
        Self::Geographic {
            near_deg: place.longitude_deg,
        }
    }

    /// Its code in the EPSG registry.
    pub fn epsg(&self) -> u16 {
        match self {
            Self::Utm(zone) => zone.epsg(),
            Self::Geographic { .. } => 4326,
        }
    }

    /// Coordinates of a place: to the east and to the north.
    ///
    /// # Errors
    /// [`MapError::Utm`] far from the zone.
    pub fn coordinates(&self, place: &Geodetic) -> Result<[f64; 2], MapError> {
        match *self {
            Self::Utm(zone) => {
                let at = Utm::in_zone(place, zone)?;
                Ok([at.easting_m, at.northing_m])
            }
            Self::Geographic { near_deg } => {
                let away = (place.longitude_deg - near_deg + 180.0).rem_euclid(360.0) - 180.0;
                Ok([near_deg + away, place.latitude_deg])
            }
        }
    }

    /// The place on the ellipsoid of such coordinates. The inverse of [`Self::coordinates`].
    pub fn place(&self, [east, north]: [f64; 2]) -> Geodetic {
        match *self {
            Self::Utm(zone) => Utm {
                zone,
                easting_m: east,
                northing_m: north,
            }
            .to_geodetic(0.0),
            Self::Geographic { .. } => Geodetic {
                latitude_deg: north,
                longitude_deg: east,
                height_m: 0.0,
            },
        }
    }

    /// Metres on the ground for one unit to the east and to the north, at a place; of UTM within its scale, 0.9996 to 1.001.
    pub fn metres(&self, place: &Geodetic) -> [f64; 2] {
        match self {
            Self::Utm(_) => [1.0; 2],
            Self::Geographic { .. } => {
                let degree = 1f64.to_radians();
                [[0.0, degree], [degree, 0.0]].map(|[lat, lon]| place.direction(lat, lon).length())
            }
        }
    }
}
