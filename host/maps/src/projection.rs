//! Map projections on WGS 84.

use subaperture_model::geometry::{Geodetic, Utm, Zone};

use crate::MapError;

/// Map projection on WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// UTM easting and northing, metres.
    Utm(Zone),
    /// Longitude and latitude, degrees (EPSG 4326). Longitudes are within 180 degrees of a reference meridian, so that a map may
    /// cross the antimeridian.
    Geographic {
        /// Reference meridian, degrees.
        near_deg: f64,
    },
}

impl Projection {
    /// UTM in the zone of a position.
    ///
    /// # Errors
    /// [`MapError::Utm`] north of 84 or south of -80 degrees.
    pub fn utm(place: &Geodetic) -> Result<Self, MapError> {
        Ok(Self::Utm(Zone::of(place)?))
    }

    /// Longitude and latitude about a position's meridian.
    pub fn geographic(place: &Geodetic) -> Self {
        Self::Geographic {
            near_deg: place.longitude_deg,
        }
    }

    /// EPSG code.
    pub fn epsg(&self) -> u16 {
        match self {
            Self::Utm(zone) => zone.epsg(),
            Self::Geographic { .. } => 4326,
        }
    }

    /// East and north coordinate of a position, in the projection's unit.
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

    /// Position on the ellipsoid of east and north coordinates. The inverse of [`Self::coordinates`].
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

    /// Ground distance of one unit to the east and to the north at a position, metres. UTM: 1, exact within its scale factor, 0.9996 to 1.001.
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
