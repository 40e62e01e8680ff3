//! A patch as a pulse's antennas see it.

use glam::DVec3;

use crate::patch::Rectangle;
use subaperture_model::geometry::ImageGrid;

/// Allowance for what lies between the places at which paths are looked at.
pub(super) const MARGIN: f64 = 1.05;
/// A polar patch that spans more, radians, is not flat enough for its corners to stand for it.
const WIDEST_SECTOR_RAD: f64 = 0.5;

/// One pulse, recorded or decimated.
#[derive(Clone, Copy)]
pub(super) struct Antennas {
    pub(super) transmitter_m: DVec3,
    pub(super) receiver_m: DVec3,
    /// Path to which its phase is compensated.
    pub(super) datum_m: f64,
}

impl Antennas {
    pub(super) fn path_m(&self, point: DVec3) -> f64 {
        let out_m = point.distance(self.transmitter_m);
        if self.transmitter_m == self.receiver_m {
            2.0 * out_m
        } else {
            out_m + point.distance(self.receiver_m)
        }
    }
}

/// A rectangle as the antennas see it.
pub(super) struct Patch {
    pub(super) centre: DVec3,
    pub(super) corners: [DVec3; 4],
    /// Farthest from the centre that a pixel lies, metres.
    pub(super) radius_m: f64,
    /// Whether it is a parallelogram, or so small a sector that it nearly is.
    pub(super) flat: bool,
}

impl Patch {
    pub(super) fn new(grid: &ImageGrid, rectangle: Rectangle) -> Self {
        let point = |(row, column)| rectangle.point_m(grid, row, column);
        let centre = rectangle.centre_m(grid);
        let sides = [(0.0, 0.5), (0.5, 0.0), (0.5, 1.0), (1.0, 0.5)].map(point);
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)].map(point);
        let farthest = corners.iter().chain(&sides).map(|p| p.distance(centre));
        let span_rad = rectangle.size.columns as f64 * grid.columns.step.abs();
        let flat = !grid.polar || span_rad <= WIDEST_SECTOR_RAD;
        let mut radius_m = farthest.fold(0.0, f64::max);
        if !flat {
            // A sector lies within its outer radius of the pole.
            let outer_m = corners.map(|p| p.distance(grid.origin_m));
            let outer_m = outer_m.into_iter().fold(0.0, f64::max);
            radius_m = outer_m + centre.distance(grid.origin_m);
        }
        Self {
            centre,
            corners,
            radius_m,
            flat,
        }
    }

    /// Largest difference of paths from one pulse to a pixel and to the centre, metres.
    pub(super) fn depth_m(&self, antennas: &Antennas) -> f64 {
        // By the triangle inequality, out and back.
        let most_m = 2.0 * self.radius_m;
        if !self.flat {
            return most_m;
        }
        let centre_m = antennas.path_m(self.centre);
        let slope = |antenna: DVec3| (self.centre - antenna).normalize_or_zero();
        let slope = slope(antennas.transmitter_m) + slope(antennas.receiver_m);
        let depth_m = |&corner: &DVec3| {
            let above_m = antennas.path_m(corner) - centre_m;
            above_m.max(-slope.dot(corner - self.centre))
        };
        let depth_m = self.corners.iter().map(depth_m).fold(0.0, f64::max);
        (depth_m * MARGIN).min(most_m)
    }

    pub(super) fn distance_m(&self, antennas: &Antennas) -> f64 {
        let transmitter_m = antennas.transmitter_m.distance(self.centre);
        transmitter_m.min(antennas.receiver_m.distance(self.centre))
    }
}
