//! Geographic extent of a grid on the ground.

use std::fmt;

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use crate::terrain::TerrainError;

/// Lowest and highest ground on the Earth, metres above the ellipsoid.
pub(crate) const GROUND_M: [f64; 2] = [-600.0, 9000.0];

/// Smallest supported cosine between a plane's normal and the vertical.
pub(crate) const MIN_COSINE: f64 = 0.2;

/// Samples along each side of a grid.
const SIDE: usize = 17;

/// Margin on all sides, degrees (11 m of latitude).
const MARGIN_DEG: f64 = 1e-4;

/// Range of latitudes and longitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// South and north, degrees.
    pub latitudes_deg: [f64; 2],
    /// West and east, degrees. East is the larger and may exceed 180.
    pub longitudes_deg: [f64; 2],
}

impl Region {
    /// Extent of the points where the plane's normals at the grid's pixels may intersect the ground, at any terrain height.
    ///
    /// # Errors
    /// [`TerrainError::Local`] if the frame has no position on the Earth; [`TerrainError::Steep`] if the plane is too steep.
    pub fn of(grid: &ImageGrid, frame: &SceneFrame) -> Result<Self, TerrainError> {
        let mut places = Vec::new();
        let [low_m, high_m] = plane_box(grid);
        let along = |i: usize, part: usize| {
            low_m[i] + (high_m[i] - low_m[i]) * part as f64 / (SIDE - 1) as f64
        };
        let normal = grid.normal();
        for row in 0..SIDE {
            for column in 0..SIDE {
                let foot =
                    grid.origin_m + grid.x_axis * along(0, column) + grid.y_axis * along(1, row);
                let place = frame.geodetic(foot).ok_or(TerrainError::Local)?;
                let up = frame.direction_from_ecf(place.east_north_up()[2]);
                let cosine = up.dot(normal);
                if cosine.abs() < MIN_COSINE {
                    return Err(TerrainError::Steep {
                        surface: "the ground".to_owned(),
                        latitude_deg: place.latitude_deg,
                        longitude_deg: place.longitude_deg,
                    });
                }
                for height_m in GROUND_M {
                    let there = foot + normal * ((height_m - place.height_m) / cosine);
                    places.push(frame.geodetic(there).ok_or(TerrainError::Local)?);
                }
            }
        }
        Ok(Self::around(&places))
    }

    /// Smallest region that contains `places`, plus the margin.
    fn around(places: &[Geodetic]) -> Self {
        let first = places.first().map_or(0.0, |place| place.longitude_deg);
        let mut region = Self {
            latitudes_deg: [90.0, -90.0],
            longitudes_deg: [f64::INFINITY, f64::NEG_INFINITY],
        };
        for place in places {
            // Longitude difference from the first, in -180 to 180.
            let east = (place.longitude_deg - first + 180.0).rem_euclid(360.0) - 180.0;
            let values = [place.latitude_deg, first + east];
            for ([low, high], value) in [&mut region.latitudes_deg, &mut region.longitudes_deg]
                .into_iter()
                .zip(values)
            {
                *low = low.min(value - MARGIN_DEG);
                *high = high.max(value + MARGIN_DEG);
            }
        }
        // A region wider than 180 degrees contains a pole.
        let [west, east] = region.longitudes_deg;
        if east - west > 180.0 {
            region.longitudes_deg = [first - 180.0, first + 180.0];
            let [south, north] = &mut region.latitudes_deg;
            match *north + *south > 0.0 {
                true => *north = 90.0,
                false => *south = -90.0,
            }
        }
        region
    }

    /// Regular samples of the region, row by row, edges included.
    pub(crate) fn places(&self) -> impl Iterator<Item = Geodetic> + '_ {
        let part =
            |[low, high]: [f64; 2], i: usize| low + (high - low) * i as f64 / (SIDE - 1) as f64;
        (0..SIDE * SIDE).map(move |i| Geodetic {
            latitude_deg: part(self.latitudes_deg, i / SIDE),
            longitude_deg: part(self.longitudes_deg, i % SIDE),
            height_m: 0.0,
        })
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([south, north], [west, east]) = (self.latitudes_deg, self.longitudes_deg);
        write!(
            f,
            "latitude {south:.4} to {north:.4}, longitude {west:.4} to {east:.4}"
        )
    }
}

/// Bounding box of a grid's pixels in its plane, `[[x, y] low, [x, y] high]`, metres.
pub(crate) fn plane_box(grid: &ImageGrid) -> [[f64; 2]; 2] {
    let ends =
        |axis: &subaperture_model::geometry::Axis| [axis.start - axis.step, axis.at(axis.count)];
    let (rows, columns) = (ends(&grid.rows), ends(&grid.columns));
    if !grid.polar {
        return [[columns[0], rows[0]], [columns[1], rows[1]]];
    }
    // Enough angles that an arc deviates from its chord by less than a thousandth of the range.
    const ANGLES: usize = 512;
    let reach = rows[0].abs().max(rows[1].abs()) * 1e-3;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let sector = (columns[1] - columns[0]).min(std::f64::consts::TAU);
    for i in 0..=ANGLES {
        let angle = columns[0] + sector * i as f64 / ANGLES as f64;
        for range in rows {
            let place = grid.plane_m(range, angle);
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis] - reach);
                high[axis] = high[axis].max(place[axis] + reach);
            }
        }
    }
    [low, high]
}
