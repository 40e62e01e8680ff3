//! Universal Transverse Mercator (UTM) coordinates on WGS 84.
//!
//! The transverse Mercator projection is conformal and true to scale, up to the factor 0.9996, along a meridian.
//! Computed by Krueger's series of sixth order in the third flattening, with the coefficients of C. F. F. Karney,
//! "Transverse Mercator with an accuracy of a few nanometers", J. Geodesy 85 (2011), (7) to (15), (35) and (36).
//! Within 30 degrees of the meridian the truncation error is below 5 nm; float64 rounds northings to 2 nm.
//!
//! **Axes**: easting and northing in metres. The easting of the zone's meridian is 500 km; the northing of the
//! equator is 0, and 10 000 km in southern zones.

use super::Geodetic;
use super::geodetic::{ECCENTRICITY2, FLATTENING, SEMI_MAJOR_M};

/// Scale factor along the zone's meridian.
const SCALE: f64 = 0.9996;
/// Easting of the zone's meridian, metres.
const FALSE_EASTING_M: f64 = 500_000.0;
/// Northing of the equator in southern zones, metres.
const FALSE_NORTHING_M: f64 = 10_000_000.0;
/// Maximum distance from a zone's meridian, degrees of longitude; zones are 6 degrees wide.
const MAX_AWAY_DEG: f64 = 30.0;

/// Zone number and hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Zone {
    number: u8,
    north: bool,
}

/// Position in a zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Utm {
    /// Zone of the coordinates.
    pub zone: Zone,
    /// Easting, metres.
    pub easting_m: f64,
    /// Northing, metres.
    pub northing_m: f64,
}

/// Error of a conversion to UTM coordinates.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UtmError {
    /// The latitude is outside the UTM zones.
    #[error("latitude: expected 80 degrees south to 84 degrees north for UTM, found {0} degrees")]
    Latitude(f64),
    /// The longitude is too far from the zone.
    #[error(
        "longitude {longitude_deg} degrees is more than {MAX_AWAY_DEG} degrees from the meridian of UTM zone {zone}"
    )]
    Away {
        /// Longitude of the position.
        longitude_deg: f64,
        /// The zone.
        zone: Zone,
    },
    /// The zone number is not 1 to 60.
    #[error("UTM zone: expected 1 to 60, found {0}")]
    Zone(u8),
}

impl std::fmt::Display for Zone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.number, if self.north { 'N' } else { 'S' })
    }
}

impl Zone {
    /// Create a zone from its number, 1 to 60, and hemisphere.
    ///
    /// # Errors
    /// [`UtmError::Zone`].
    pub fn new(number: u8, north: bool) -> Result<Self, UtmError> {
        match number {
            1..=60 => Ok(Self { number, north }),
            _ => Err(UtmError::Zone(number)),
        }
    }

    /// Zone of a position, including the wider zones of Norway and Svalbard.
    ///
    /// # Errors
    /// [`UtmError::Latitude`], also for numbers that are not finite.
    pub fn of(place: &Geodetic) -> Result<Self, UtmError> {
        let (latitude, longitude) = (place.latitude_deg, wrapped(place.longitude_deg));
        if !((-80.0..=84.0).contains(&latitude) && longitude.is_finite()) {
            return Err(UtmError::Latitude(latitude));
        }
        let even = ((longitude + 180.0) / 6.0) as u8 % 60 + 1;
        let number = match () {
            () if (56.0..64.0).contains(&latitude) && (3.0..12.0).contains(&longitude) => 32,
            () if latitude >= 72.0 && (0.0..42.0).contains(&longitude) => {
                31 + 2 * ((longitude + 3.0) / 12.0) as u8
            }
            () => even,
        };
        Ok(Self {
            number,
            north: latitude >= 0.0,
        })
    }

    /// Zone number, 1 to 60.
    pub fn number(&self) -> u8 {
        self.number
    }

    /// Whether the zone is north of the equator.
    pub fn is_north(&self) -> bool {
        self.north
    }

    /// Meridian of the zone, degrees east.
    pub fn meridian_deg(&self) -> f64 {
        6.0 * f64::from(self.number) - 183.0
    }

    /// EPSG code of the zone on WGS 84.
    pub fn epsg(&self) -> u16 {
        let first = if self.north { 32_600 } else { 32_700 };
        first + u16::from(self.number)
    }
}

impl Utm {
    /// UTM coordinates of a position in its own zone.
    ///
    /// # Errors
    /// [`UtmError`].
    pub fn of(place: &Geodetic) -> Result<Self, UtmError> {
        Self::in_zone(place, Zone::of(place)?)
    }

    /// Project a point into `zone`, which may be a neighbour of its own zone, so that an area across a zone boundary has one set of axes.
    ///
    /// # Errors
    /// [`UtmError`].
    pub fn in_zone(place: &Geodetic, zone: Zone) -> Result<Self, UtmError> {
        let latitude_deg = place.latitude_deg;
        if latitude_deg.is_nan() || latitude_deg.abs() > 90.0 {
            return Err(UtmError::Latitude(latitude_deg));
        }
        let away_deg = wrapped(place.longitude_deg - zone.meridian_deg());
        if away_deg.is_nan() || away_deg.abs() > MAX_AWAY_DEG {
            return Err(UtmError::Away {
                longitude_deg: place.longitude_deg,
                zone,
            });
        }
        let [east, north] = project(latitude_deg.to_radians(), away_deg.to_radians());
        Ok(Self {
            zone,
            easting_m: FALSE_EASTING_M + SCALE * east,
            northing_m: SCALE * north + if zone.north { 0.0 } else { FALSE_NORTHING_M },
        })
    }

    /// Convert to geodetic coordinates at this height above the ellipsoid. Inverse of [`Self::in_zone`].
    pub fn to_geodetic(&self, height_m: f64) -> Geodetic {
        let equator_m = if self.zone.north {
            0.0
        } else {
            FALSE_NORTHING_M
        };
        let east = (self.easting_m - FALSE_EASTING_M) / SCALE;
        let [latitude, away] = unproject([east, (self.northing_m - equator_m) / SCALE]);
        Geodetic {
            latitude_deg: latitude.to_degrees(),
            longitude_deg: wrapped(self.zone.meridian_deg() + away.to_degrees()),
            height_m,
        }
    }
}

/// Longitude wrapped to -180 to 180 degrees.
fn wrapped(degrees: f64) -> f64 {
    if (-180.0..180.0).contains(&degrees) {
        return degrees;
    }
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

/// Third flattening.
const N: f64 = FLATTENING / (2.0 - FLATTENING);

/// Radius of the circle with the circumference of a meridian, metres: Karney's (14).
fn rectifying_m() -> f64 {
    let n2 = N * N;
    SEMI_MAJOR_M / (1.0 + N) * (1.0 + n2 / 4.0 + n2 * n2 / 64.0 + n2 * n2 * n2 / 256.0)
}

/// Polynomials in the third flattening; series `j` starts at the power `j`.
fn series(coefficients: [&[f64]; 6]) -> [f64; 6] {
    let mut power = 1.0;
    coefficients.map(|all| {
        power *= N;
        power * all.iter().rev().fold(0.0, |sum, c| sum * N + c)
    })
}

/// Coefficients alpha, Karney's (35).
fn alpha() -> [f64; 6] {
    series([
        &[
            1.0 / 2.0,
            -2.0 / 3.0,
            5.0 / 16.0,
            41.0 / 180.0,
            -127.0 / 288.0,
            7891.0 / 37_800.0,
        ],
        &[
            13.0 / 48.0,
            -3.0 / 5.0,
            557.0 / 1440.0,
            281.0 / 630.0,
            -1_983_433.0 / 1_935_360.0,
        ],
        &[
            61.0 / 240.0,
            -103.0 / 140.0,
            15_061.0 / 26_880.0,
            167_603.0 / 181_440.0,
        ],
        &[
            49_561.0 / 161_280.0,
            -179.0 / 168.0,
            6_601_661.0 / 7_257_600.0,
        ],
        &[34_729.0 / 80_640.0, -3_418_889.0 / 1_995_840.0],
        &[212_378_941.0 / 319_334_400.0],
    ])
}

/// Coefficients beta, Karney's (36).
fn beta() -> [f64; 6] {
    series([
        &[
            1.0 / 2.0,
            -2.0 / 3.0,
            37.0 / 96.0,
            -1.0 / 360.0,
            -81.0 / 512.0,
            96_199.0 / 604_800.0,
        ],
        &[
            1.0 / 48.0,
            1.0 / 15.0,
            -437.0 / 1440.0,
            46.0 / 105.0,
            -1_118_711.0 / 3_870_720.0,
        ],
        &[
            17.0 / 480.0,
            -37.0 / 840.0,
            -209.0 / 4480.0,
            5569.0 / 90_720.0,
        ],
        &[4397.0 / 161_280.0, -11.0 / 504.0, -830_251.0 / 7_257_600.0],
        &[4583.0 / 161_280.0, -108_847.0 / 3_991_680.0],
        &[20_648_693.0 / 638_668_800.0],
    ])
}

/// Tangent of the conformal latitude from that of the geodetic latitude: (7) to (9).
fn conformal(tan: f64) -> f64 {
    let e = ECCENTRICITY2.sqrt();
    let secant = libm::hypot(1.0, tan);
    let sigma = libm::sinh(e * libm::atanh(e * tan / secant));
    tan * libm::hypot(1.0, sigma) - sigma * secant
}

/// `sum_j c_j (sin 2j x cosh 2j y, cos 2j x sinh 2j y)`.
fn waves(c: [f64; 6], x: f64, y: f64) -> [f64; 2] {
    (1u8..).zip(c).fold([0.0; 2], |[a, b], (j, c)| {
        let twice = 2.0 * f64::from(j);
        let (sin, cos) = libm::sincos(twice * x);
        let (sinh, cosh) = (libm::sinh(twice * y), libm::cosh(twice * y));
        [a + c * sin * cosh, b + c * cos * sinh]
    })
}

/// Unscaled easting and northing from the meridian and the equator, metres: (10), (11).
fn project(latitude: f64, away: f64) -> [f64; 2] {
    let tan = conformal(libm::tan(latitude));
    let (sin, cos) = libm::sincos(away);
    let x = libm::atan2(tan, cos);
    let y = libm::asinh(sin / libm::hypot(tan, cos));
    let [dx, dy] = waves(alpha(), x, y);
    [rectifying_m() * (y + dy), rectifying_m() * (x + dx)]
}

/// Inverse of [`project`]: (15), (18), and Newton's method (19) to (21), which reaches float64 precision after three
/// steps.
fn unproject([east, north]: [f64; 2]) -> [f64; 2] {
    let (x, y) = (north / rectifying_m(), east / rectifying_m());
    let [dx, dy] = waves(beta(), x, y);
    let (x, y) = (x - dx, y - dy);
    let (sin, cos) = libm::sincos(x);
    let wanted = sin / libm::hypot(libm::sinh(y), cos);
    let mut tan = wanted;
    for _ in 0..5 {
        let has = conformal(tan);
        let slope = (1.0 + (1.0 - ECCENTRICITY2) * tan * tan)
            / ((1.0 - ECCENTRICITY2) * libm::hypot(1.0, tan));
        tan += (wanted - has) / libm::hypot(1.0, has) * slope;
    }
    [libm::atan(tan), libm::atan2(libm::sinh(y), cos)]
}

#[cfg(test)]
mod tests;
