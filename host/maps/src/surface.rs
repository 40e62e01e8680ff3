//! Projection of map positions into an image.
//!
//! An image shows the points of the surface on which it was focused: its grid's plane, or the relief over it. A map position shows the point where the
//! ellipsoid's normal intersects that surface. Objects above or below the surface are displaced by layover, as in the image; objects on the surface
//! are at their true position.

use std::f64::consts::PI;

use glam::DVec3;

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use crate::{MapError, ProjectionModel};

/// Smallest supported sine of the angle between a plane and the vertical.
const MIN_SINE: f64 = 0.05;

/// Outline points per side of a grid.
const SIDE_PLACES: usize = 256;

/// Largest number of iterations for a relief's point on a vertical. Each multiplies the error by the relief's slope times the tilt between normal and vertical.
const MAX_STEPS: usize = 60;

/// Convergence threshold, metres.
const NEAR_M: f64 = 1e-6;

/// Surface of an image's pixels.
#[derive(Clone, Debug)]
pub(crate) enum Surface<'a> {
    /// Surface of a grid.
    Grid(Box<OnGrid>),
    /// Projection of the image's own metadata, and its rows and columns.
    Projected(&'a dyn ProjectionModel, [usize; 2]),
}

impl Surface<'_> {
    pub(crate) fn of_grid(grid: &ImageGrid, frame: &SceneFrame) -> Result<Self, MapError> {
        Ok(Self::Grid(Box::new(OnGrid::new(grid, frame)?)))
    }

    /// Surface of a grid in a scene that may have no position on the Earth: points, but no ground positions.
    pub(crate) fn in_scene(grid: &ImageGrid, frame: &SceneFrame) -> Self {
        Self::Grid(Box::new(OnGrid::unchecked(grid, frame)))
    }

    /// Rows and columns of the image.
    pub(crate) fn counts(&self) -> [usize; 2] {
        match self {
            Self::Grid(own) => [own.grid.rows.count, own.grid.columns.count],
            Self::Projected(_, counts) => *counts,
        }
    }

    /// Position of the image centre.
    pub(crate) fn centre(&self) -> Result<Geodetic, MapError> {
        self.place(self.counts().map(|count| 0.5 * (count - 1) as f64))
    }

    /// Where a pixel is, rows and columns from 0.
    pub(crate) fn place(&self, pixel: [f64; 2]) -> Result<Geodetic, MapError> {
        match self {
            Self::Grid(own) => own.place(pixel),
            Self::Projected(model, _) => model.place(pixel).ok_or(MapError::Nowhere {
                row: pixel[0],
                column: pixel[1],
            }),
        }
    }

    /// Outline along the outer pixel edges, `along` points per side, from the first row and column along the row.
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

    /// Row and column spacing, metres; of a polar grid at its middle range.
    pub(crate) fn steps_m(&self) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.steps_m(),
            Self::Projected(model, _) => model.steps_m(),
        }
    }

    /// Whether [`Self::on_plane`] is smooth enough for interpolation by parabolas.
    pub(crate) fn is_smooth(&self) -> bool {
        match self {
            Self::Grid(own) => own.grid.relief.is_none(),
            Self::Projected(..) => true,
        }
    }

    /// Plane coordinates of a position: foot in the grid's plane, metres, or fractional row and column.
    pub(crate) fn on_plane(&self, place: &Geodetic) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.on_plane(place),
            Self::Projected(model, _) => model.pixel(place).unwrap_or([f64::NAN; 2]),
        }
    }

    /// Fractional row and column of plane coordinates.
    #[inline]
    pub(crate) fn pixel(&self, coordinates: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Grid(own) => own.pixel(coordinates),
            Self::Projected(..) => coordinates,
        }
    }
}

/// Surface of a grid in a frame.
#[derive(Clone, Debug)]
pub(crate) struct OnGrid {
    pub(crate) grid: ImageGrid,
    pub(crate) frame: SceneFrame,
    normal: DVec3,
    /// Middle angle of a polar grid, radians.
    middle_rad: f64,
}

impl OnGrid {
    fn new(grid: &ImageGrid, frame: &SceneFrame) -> Result<Self, MapError> {
        let surface = Self::unchecked(grid, frame);
        let half = |count: usize| 0.5 * (count - 1) as f64;
        let centre = surface.place([half(grid.rows.count), half(grid.columns.count)])?;
        let up = frame.direction_from_ecf(centre.east_north_up()[2]);
        match up.dot(surface.normal).abs() > MIN_SINE {
            true => Ok(surface),
            false => Err(MapError::Upright),
        }
    }

    fn unchecked(grid: &ImageGrid, frame: &SceneFrame) -> Self {
        let columns = &grid.columns;
        Self {
            grid: grid.clone(),
            frame: *frame,
            normal: grid.normal(),
            middle_rad: columns.start + 0.5 * (columns.count - 1) as f64 * columns.step,
        }
    }

    /// Foot of a point of the scene in the plane, metres along the plane's axes from the grid's origin.
    pub(crate) fn foot(&self, point_m: DVec3) -> [f64; 2] {
        let from = point_m - self.grid.origin_m;
        [from.dot(self.grid.x_axis), from.dot(self.grid.y_axis)]
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

    /// Foot in the plane of the surface point on a position's vertical, metres along the plane's axes from the grid's origin.
    fn on_plane(&self, place: &Geodetic) -> [f64; 2] {
        let point = self.frame.from_ecf_m(place.to_ecf_m());
        let up = self.frame.direction_from_ecf(place.east_north_up()[2]);
        let from = point - self.grid.origin_m;
        let (depth, rise) = (from.dot(self.normal), up.dot(self.normal));
        // Foot of the vertical's point at this height over the plane.
        let at = |height_m: f64| {
            let there = from + up * ((height_m - depth) / rise);
            [there.dot(self.grid.x_axis), there.dot(self.grid.y_axis)]
        };
        let mut found = at(0.0);
        if let Some(relief) = &self.grid.relief {
            let mut height_m = 0.0;
            for _ in 0..MAX_STEPS {
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

    /// Surface point over plane coordinates.
    pub(crate) fn point_m(&self, [x, y]: [f64; 2]) -> DVec3 {
        let flat = self.grid.origin_m + self.grid.x_axis * x + self.grid.y_axis * y;
        match &self.grid.relief {
            None => flat,
            Some(relief) => flat + self.normal * relief.height_m(x, y),
        }
    }

    /// Fractional row and column of plane coordinates.
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
