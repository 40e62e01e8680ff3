//! Post positions of a raster on the Earth.

use subaperture_model::geometry::{Geodetic, Utm, Zone};

/// Coordinates in which posts are evenly spaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Projection {
    /// Longitude and latitude on WGS 84, degrees.
    Geographic,
    /// UTM easting and northing on WGS 84, metres.
    Utm(Zone),
}

/// Regular lattice of posts: `origin` is the post of row 0 and column 0, `steps` are the row and column spacing, in the projection's coordinates,
/// easting or longitude first. Rows usually run south, so that the row step is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    pub(crate) projection: Projection,
    /// East, north.
    pub(crate) origin: [f64; 2],
    /// Row step northwards, column step eastwards.
    pub(crate) steps: [f64; 2],
    /// Middle column, about which longitudes are wrapped.
    pub(crate) middle_column: f64,
}

impl Lattice {
    /// Fractional row and column of a position; `None` outside the projection's domain.
    pub(crate) fn at(&self, latitude_deg: f64, longitude_deg: f64) -> Option<[f64; 2]> {
        let [east, north] = match self.projection {
            Projection::Geographic => [longitude_deg, latitude_deg],
            Projection::Utm(zone) => {
                let place = Geodetic {
                    latitude_deg,
                    longitude_deg: (longitude_deg + 180.0).rem_euclid(360.0) - 180.0,
                    height_m: 0.0,
                };
                let there = Utm::in_zone(&place, zone).ok()?;
                [there.easting_m, there.northing_m]
            }
        };
        let row = (north - self.origin[1]) / self.steps[0];
        let mut column = (east - self.origin[0]) / self.steps[1];
        if self.projection == Projection::Geographic {
            let around = (360.0 / self.steps[1]).abs();
            let first = self.middle_column - 0.5 * around;
            column = (column - first).rem_euclid(around) + first;
        }
        Some([row, column])
    }

    /// Latitude and longitude, degrees, of a row and column. The inverse of [`Self::at`].
    pub(crate) fn place(&self, [row, column]: [f64; 2]) -> [f64; 2] {
        let north = self.origin[1] + row * self.steps[0];
        let east = self.origin[0] + column * self.steps[1];
        match self.projection {
            Projection::Geographic => [north, east],
            Projection::Utm(zone) => {
                let there = Utm {
                    zone,
                    easting_m: east,
                    northing_m: north,
                };
                let place = there.to_geodetic(0.0);
                [place.latitude_deg, place.longitude_deg]
            }
        }
    }

    /// Whether so many columns go around the Earth, but for less than the next.
    pub(crate) fn goes_around(&self, columns: usize) -> bool {
        let turn = columns as f64 * self.steps[1].abs();
        self.projection == Projection::Geographic && turn > 360.0 - 0.5 * self.steps[1].abs()
    }

    /// Approximate post spacing at a latitude, metres; the smaller of row and column spacing.
    pub(crate) fn step_m(&self, latitude_deg: f64) -> f64 {
        /// Metres a degree of latitude.
        const DEGREE_M: f64 = 111_195.0;
        let [rows, columns] = self.steps.map(f64::abs);
        match self.projection {
            Projection::Utm(_) => rows.min(columns),
            Projection::Geographic => {
                let shrink = libm::cos(latitude_deg.to_radians()).abs().max(0.01);
                (rows * DEGREE_M).min(columns * DEGREE_M * shrink)
            }
        }
    }
}
