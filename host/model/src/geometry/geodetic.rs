//! WGS 84: geodetic coordinates, local directions, and the tangent axes of an HAE surface.

use glam::DVec3;

/// Semi-major axis, metres, and first eccentricity squared, of WGS 84.
pub(super) const SEMI_MAJOR_M: f64 = 6_378_137.0;
pub(super) const FLATTENING: f64 = 1.0 / 298.257_223_563;
pub(super) const ECCENTRICITY2: f64 = FLATTENING * (2.0 - FLATTENING);

/// Limit of Bowring iterations; two suffice up to some hundred kilometres of height.
const MAX_STEPS: usize = 20;

/// Position by latitude, longitude and height above the WGS 84 ellipsoid.
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
    /// Convert from Earth-centred Earth-fixed coordinates in metres by Bowring's iteration. The error is some
    /// roundings of the coordinates (2e-9 m at the Earth's surface) from 1000 km below the surface to any height. At
    /// the poles the longitude is 0. Nearer to the Earth's centre several solutions exist; any of them may be
    /// returned.
    pub fn from_ecf_m(position: DVec3) -> Self {
        let axis_m = libm::hypot(position.x, position.y);
        let minor_m = SEMI_MAJOR_M * (1.0 - FLATTENING);
        let second = ECCENTRICITY2 / (1.0 - ECCENTRICITY2);
        // Sine and cosine of the reduced latitude. Each step reduces the error by a factor of at least 100, and of a
        // million near the surface.
        let unit = |z: f64, x: f64| {
            let length = libm::hypot(z, x);
            if length > 0.0 {
                [z / length, x / length]
            } else {
                [0.0, 1.0]
            }
        };
        let mut reduced = unit(position.z, axis_m * (1.0 - FLATTENING));
        let mut latitude = [0.0, 1.0];
        for _ in 0..MAX_STEPS {
            let [sin, cos] = reduced;
            latitude = unit(
                position.z + second * minor_m * sin * sin * sin,
                (axis_m - ECCENTRICITY2 * SEMI_MAJOR_M * cos * cos * cos).max(0.0),
            );
            let [sin, cos] = latitude;
            let next = unit((1.0 - FLATTENING) * sin, cos);
            let moved = (next[0] * reduced[1] - next[1] * reduced[0]).abs();
            reduced = next;
            if moved < f64::EPSILON {
                break;
            }
        }
        let [sin, cos] = latitude;
        Self {
            latitude_deg: libm::atan2(sin, cos).to_degrees(),
            longitude_deg: libm::atan2(position.y, position.x).to_degrees(),
            // Distance along the normal minus its part inside the ellipsoid.
            height_m: axis_m * cos + position.z * sin
                - SEMI_MAJOR_M * (1.0 - ECCENTRICITY2 * sin * sin).sqrt(),
        }
    }

    /// Convert to Earth-centred Earth-fixed coordinates in metres. Inverse of [`Self::from_ecf_m`].
    pub fn to_ecf_m(&self) -> DVec3 {
        let (sin_lat, cos_lat) = libm::sincos(self.latitude_deg.to_radians());
        let (sin_lon, cos_lon) = libm::sincos(self.longitude_deg.to_radians());
        let prime_vertical_m = SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * sin_lat * sin_lat).sqrt();
        let axis_m = (prime_vertical_m + self.height_m) * cos_lat;
        let z = (prime_vertical_m * (1.0 - ECCENTRICITY2) + self.height_m) * sin_lat;
        DVec3::new(axis_m * cos_lon, axis_m * sin_lon, z)
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

    /// Direction of an increment in latitude and longitude (radians): north by the meridian's radius of curvature,
    /// east by the parallel's radius, both at this height. For an HAE reference surface the increments are `uIAXLL`
    /// or `uIAYLL`, radians per metre along the image axis, so the result has a length of about 1 m.
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

    /// Definition of geodetic coordinates: x = (N + h) cos(lat) cos(lon) and so on.
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
            (45.0, -84.0, 1e-3),
            (-70.3, 10.0, -10_000.0),
            (45.0, 45.0, 100_000.0),
            (38.2, -178.0, 1_000_000.0),
            (-12.0, 100.0, 35_786_000.0),
        ] {
            let place = Geodetic {
                latitude_deg,
                longitude_deg,
                height_m,
            };
            // Positions have roundings of about 1e-9 m, those of satellites more.
            let scale = 1.0 + height_m.abs() / SEMI_MAJOR_M;
            assert!(place.to_ecf_m().distance(to_ecf(place)) < 1e-8 * scale);
            let back = Geodetic::from_ecf_m(to_ecf(place));
            // Float64 resolves 1e-9 m at 6.4e6 m: 1e-8 m allows ten roundings, and 1e-8 m of
            // ground is 1e-13 degrees (over cos(latitude) for the longitude).
            assert!((back.height_m - height_m).abs() < 1e-8 * scale, "{back:?}");
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

    #[test]
    fn poles_and_centre_convert_to_finite_coordinates() {
        let polar_m = SEMI_MAJOR_M * (1.0 - FLATTENING);
        for sign in [1.0, -1.0] {
            let pole = Geodetic::from_ecf_m(DVec3::new(0.0, 0.0, sign * (polar_m + 20.0)));
            assert_eq!(pole.latitude_deg, sign * 90.0);
            assert!((pole.height_m - 20.0).abs() < 1e-8, "{pole:?}");
            // A metre from the axis: a metre along the meridian, whose radius there is a / (1 - f).
            let near = Geodetic::from_ecf_m(DVec3::new(1.0, 0.0, sign * polar_m));
            let away = (1.0 / (SEMI_MAJOR_M / (1.0 - FLATTENING))).to_degrees();
            assert!(
                (90.0 - near.latitude_deg.abs() - away).abs() < 1e-12,
                "{near:?}"
            );
        }
        let inside = [DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::new(3e4, 0.0, 1.0)];
        for place in inside.map(Geodetic::from_ecf_m) {
            assert!(
                place.latitude_deg.is_finite() && place.height_m < -6e6,
                "{place:?}"
            );
        }
    }
}
