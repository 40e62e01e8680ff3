//! WGS 84: geodetic coordinates, local directions, and the tangent axes of an HAE surface.

use glam::DVec3;

/// Semi-major axis, metres, and first eccentricity squared, of WGS 84.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;
const ECCENTRICITY2: f64 = FLATTENING * (2.0 - FLATTENING);

/// A place by latitude, longitude and height above the WGS 84 ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Geodetic {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive, -180 to 180.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, metres.
    pub height_m: f64,
}

impl Geodetic {
    /// From Earth-centred Earth-fixed coordinates, metres. Not a number at the Earth's centre.
    pub fn from_ecf_m(position: DVec3) -> Self {
        let (latitude, longitude, height_m) =
            map_3d::ecef2geodetic(position.x, position.y, position.z, map_3d::Ellipsoid::WGS84);
        Self {
            latitude_deg: latitude.to_degrees(),
            longitude_deg: longitude.to_degrees(),
            height_m,
        }
    }

    /// Earth-centred Earth-fixed coordinates, metres. The inverse of [`Self::from_ecf_m`].
    pub fn to_ecf_m(&self) -> DVec3 {
        let (latitude, longitude) = (
            self.latitude_deg.to_radians(),
            self.longitude_deg.to_radians(),
        );
        map_3d::geodetic2ecef(latitude, longitude, self.height_m, map_3d::Ellipsoid::WGS84).into()
    }

    /// Unit vectors east, north and up (normal to the ellipsoid) in ECF.
    pub fn east_north_up(&self) -> [DVec3; 3] {
        let (sin_lat, cos_lat) = libm::sincos(self.latitude_deg.to_radians());
        let (sin_lon, cos_lon) = libm::sincos(self.longitude_deg.to_radians());
        [
            DVec3::new(-sin_lon, cos_lon, 0.0),
            DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
            DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
        ]
    }

    /// The direction of an increment in latitude and longitude (radians): north by the meridian's
    /// radius of curvature, east by the parallel's radius, both at this height. For an HAE reference
    /// surface the increments are `uIAXLL` or `uIAYLL`, radians for one metre along the image axis,
    /// so the result has a length of about 1 m.
    pub fn direction(&self, d_latitude: f64, d_longitude: f64) -> DVec3 {
        let [east, north, _] = self.east_north_up();
        let (sin_lat, cos_lat) = libm::sincos(self.latitude_deg.to_radians());
        let w2 = 1.0 - ECCENTRICITY2 * sin_lat * sin_lat;
        let prime_vertical_m = SEMI_MAJOR_M / w2.sqrt();
        let meridian_m = prime_vertical_m * (1.0 - ECCENTRICITY2) / w2;
        north * (d_latitude * (meridian_m + self.height_m))
            + east * (d_longitude * (prime_vertical_m + self.height_m) * cos_lat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x = (N + h) cos(lat) cos(lon) and so on: the definition of geodetic coordinates.
    fn to_ecf(place: Geodetic) -> DVec3 {
        let (sin_lat, cos_lat) = place.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = place.longitude_deg.to_radians().sin_cos();
        let b2_over_a2 = (1.0 - FLATTENING).powi(2);
        let n = SEMI_MAJOR_M / (cos_lat.powi(2) + b2_over_a2 * sin_lat.powi(2)).sqrt();
        DVec3::new(
            (n + place.height_m) * cos_lat * cos_lon,
            (n + place.height_m) * cos_lat * sin_lon,
            (n * b2_over_a2 + place.height_m) * sin_lat,
        )
    }

    #[test]
    fn geodetic_inverts_its_definition_and_direction_is_its_derivative() {
        for (latitude_deg, longitude_deg, height_m) in [
            (0.0, 0.0, 0.0),
            (52.1, 4.3, 43.0),
            (-33.9, 151.2, 12_000.0),
            (89.9, -170.0, -30.0),
        ] {
            let place = Geodetic {
                latitude_deg,
                longitude_deg,
                height_m,
            };
            // Places have some 1e-9 m of roundings.
            assert!(place.to_ecf_m().distance(to_ecf(place)) < 1e-8);
            let back = Geodetic::from_ecf_m(to_ecf(place));
            // Float64 resolves 1e-9 m at 6.4e6 m: 1e-8 m allows ten roundings, and 1e-8 m of
            // ground is 1e-13 degrees (over cos(latitude) for the longitude).
            assert!((back.height_m - height_m).abs() < 1e-8, "{back:?}");
            assert!((back.latitude_deg - latitude_deg).abs() < 1e-12);
            assert!((back.longitude_deg - longitude_deg).abs() < 1e-10);
            // Central difference over 2e-6 rad (about 13 m): truncation is 1e-12 of it, rounding
            // of positions 2e-9 / 13.
            let step = 1e-6f64;
            let moved = |sign: f64| {
                to_ecf(Geodetic {
                    latitude_deg: latitude_deg + sign * (0.7 * step).to_degrees(),
                    longitude_deg: longitude_deg - sign * (0.4 * step).to_degrees(),
                    height_m,
                })
            };
            let expected = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            let got = place.direction(0.7, -0.4);
            assert!((got - expected).length() < 1e-8 * expected.length());
        }
    }
}
