//! Where on an image a place of the map is.
//!
//! An image shows the points of the surface on which it was focused: of its grid's plane, or of the relief over it. A map shows each straight above or
//! below where it is: the place of the map is the point where the ellipsoid's normal there meets the surface. What stands above the surface, or lies
//! below it, is displaced by layover, here as in the image; what lies on it is where it stands.

use std::f64::consts::PI;

use glam::DVec3;

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use crate::{Lying, MapError};

/// Least sine of the angle between a plane and the vertical.
const LEAST_SINE: f64 = 0.05;

/// Places along each side of a grid by which its outline is followed.
const SIDE_PLACES: usize = 256;

/// Steps of the search for a relief's point along a vertical, of which each leaves the relief's slope times the tilt between normal and vertical.
const MOST_STEPS: usize = 60;

/// Where that search ends, metres.
const NEAR_M: f64 = 1e-6;

/// Where an image's pixels are.
#[derive(Clone, Debug)]
pub(crate) enum Surface<'a> {
    /// On a grid's surface.
    Grid(Box<OnGrid>),
    /// Where the image's own metadata say: rows and columns of so many.
    Told(&'a dyn Lying, [usize; 2]),
}

impl Surface<'_> {
    pub(crate) fn of_grid(grid: &ImageGrid, frame: &SceneFrame) -> Result<Self, MapError> {
        Ok(Self::Grid(Box::new(OnGrid::new(grid, frame)?)))
    }

    /// Rows and columns.
    pub(crate) fn counts(&self) -> [usize; 2] {
        match self {
            Self::Grid(own) => [own.grid.rows.count, own.grid.columns.count],
            Self::Told(_, counts) => *counts,
        }
    }

    /// The middle of the image.
    pub(crate) fn centre(&self) -> Result<Geodetic, MapError> {
        self.place(self.counts().map(|count| 0.5 * (count - 1) as f64))
    }

    /// Where a pixel is, rows and columns from 0.
    pub(crate) fn place(&self, pixel: [f64; 2]) -> Result<Geodetic, MapError> {
        match self {
            Self::Grid(own) => own.place(pixel),
            Self::Told(lying, _) => lying.place(pixel).ok_or(MapError::Nowhere {
                row: pixel[0],
                column: pixel[1],
            }),
        }
    }

    /// The outline of the image, along the outer edges of its pixels: from the first row and column along the row, and around.
    pub(crate) fn outline(&self, along: usize) -> Result<Vec<Geodetic>, MapError> {
        let end = |count: usize| count as f64 - 0.5;
        let [bottom, left] = [-0.5; 2];
        let [top, right] = self.counts().map(end);
        let corners = [[bottom, left], [bottom, right], [top, right], [top, left]];
        let mut places = Vec::with_capacity(4 * along);
        for (i, from) in corners.iter().enumerate() {
            let to = corners[(i + 1) % 4];
            for k in 0..along {
                let part = k as f64 / along as f64;
                places.push(
                    self.place([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part))?,
                );
            }
        }
        Ok(places)
    }

    pub(crate) fn whole_outline(&self) -> Result<Vec<Geodetic>, MapError> {
        self.outline(SIDE_PLACES)
    }

    /// Metres from pixel to pixel along rows' and columns' axes; of a polar grid in the middle of its ranges.
    pub(crate) fn steps_m(&self) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.steps_m(),
            Self::Told(lying, _) => lying.steps_m(),
        }
    }

    /// Whether what [`Self::on_plane`] tells follows the places of a map so smoothly that parabolas have it.
    pub(crate) fn is_smooth(&self) -> bool {
        match self {
            Self::Grid(own) => own.grid.relief.is_none(),
            Self::Told(..) => true,
        }
    }

    /// Coordinates in which a place's pixel follows simply: of the foot in the grid's plane, or row and column themselves.
    pub(crate) fn on_plane(&self, place: &Geodetic) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.on_plane(place),
            Self::Told(lying, _) => lying.pixel(place).unwrap_or([f64::NAN; 2]),
        }
    }

    /// Row and column, from 0 and with fractions, of such coordinates.
    #[inline]
    pub(crate) fn pixel(&self, coordinates: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.pixel(coordinates),
            Self::Told(..) => coordinates,
        }
    }
}

/// A grid's surface on the Earth.
#[derive(Clone, Debug)]
pub(crate) struct OnGrid {
    pub(crate) grid: ImageGrid,
    frame: SceneFrame,
    normal: DVec3,
    /// Of a polar grid.
    middle_rad: f64,
}

impl OnGrid {
    fn new(grid: &ImageGrid, frame: &SceneFrame) -> Result<Self, MapError> {
        let columns = &grid.columns;
        let surface = Self {
            grid: grid.clone(),
            frame: *frame,
            normal: grid.normal(),
            middle_rad: columns.start + 0.5 * (columns.count - 1) as f64 * columns.step,
        };
        let half = |count: usize| 0.5 * (count - 1) as f64;
        let centre = surface.place([half(grid.rows.count), half(grid.columns.count)])?;
        let up = frame.direction_from_ecf(centre.east_north_up()[2]);
        match up.dot(surface.normal).abs() > LEAST_SINE {
            true => Ok(surface),
            false => Err(MapError::Upright),
        }
    }

    /// Where a pixel is, rows and columns from 0.
    fn place(&self, [row, column]: [f64; 2]) -> Result<Geodetic, MapError> {
        let at = |axis: &subaperture_model::geometry::Axis, i: f64| axis.start + i * axis.step;
        let point = self
            .grid
            .point_m(at(&self.grid.rows, row), at(&self.grid.columns, column));
        self.frame.geodetic(point).ok_or(MapError::Local)
    }

    fn steps_m(&self) -> [f64; 2] {
        let rows = &self.grid.rows;
        let across = match self.grid.polar {
            true => (rows.start + 0.5 * (rows.count - 1) as f64 * rows.step).abs(),
            false => 1.0,
        };
        [rows.step, self.grid.columns.step * across]
    }

    /// The foot in the plane of the surface's point above or below a place, metres along the plane's axes from the grid's origin.
    fn on_plane(&self, place: &Geodetic) -> [f64; 2] {
        let point = self.frame.from_ecf_m(place.to_ecf_m());
        let up = self.frame.direction_from_ecf(place.east_north_up()[2]);
        let from = point - self.grid.origin_m;
        let (depth, rise) = (from.dot(self.normal), up.dot(self.normal));
        // Where the vertical is this high over the plane.
        let at = |height_m: f64| {
            let there = from + up * ((height_m - depth) / rise);
            [there.dot(self.grid.x_axis), there.dot(self.grid.y_axis)]
        };
        let mut found = at(0.0);
        if let Some(relief) = &self.grid.relief {
            let mut height_m = 0.0;
            for _ in 0..MOST_STEPS {
                let next_m = relief.height_m(found[0], found[1]);
                found = at(next_m);
                if (next_m - height_m).abs() < NEAR_M {
                    break;
                }
                height_m = next_m;
            }
        }
        found
    }

    /// The point of the surface over such a place.
    pub(crate) fn point_m(&self, [x, y]: [f64; 2]) -> DVec3 {
        let flat = self.grid.origin_m + self.grid.x_axis * x + self.grid.y_axis * y;
        match &self.grid.relief {
            None => flat,
            Some(relief) => flat + self.normal * relief.height_m(x, y),
        }
    }

    /// Row and column, from 0 and with fractions, of such a place.
    #[inline]
    fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (row_value, column_value) = match self.grid.polar {
            true => {
                let away = (libm::atan2(y, x) - self.middle_rad + PI).rem_euclid(2.0 * PI) - PI;
                (libm::hypot(x, y), self.middle_rad + away)
            }
            false => (y, x),
        };
        [
            (row_value - self.grid.rows.start) / self.grid.rows.step,
            (column_value - self.grid.columns.start) / self.grid.columns.step,
        ]
    }
}
