//! Geometry of a patch relative to the antennas of a pulse.

use glam::DVec3;

use super::thinned::Antennas;
use crate::patch::Rectangle;
use subaperture_model::geometry::{Axis, ImageGrid};

/// Margin for extremes between the sampled path positions.
pub(super) const MARGIN: f64 = 1.05;
/// Largest angle of a polar patch, radians, for which its corners represent it.
const WIDEST_SECTOR_RAD: f64 = 0.5;

/// Path from the transmitter to a point and on to the receiver, metres.
pub(super) fn path_m([transmitter, receiver]: &Antennas, point: DVec3) -> f64 {
    let out_m = point.distance(*transmitter);
    if transmitter == receiver {
        2.0 * out_m
    } else {
        out_m + point.distance(*receiver)
    }
}

/// Extent of a rectangle of pixels.
pub(super) struct Patch {
    pub(super) centre: DVec3,
    /// Four corners in the grid plane, or the eight corners of an enclosing box on a surface; paths are convex in both cases.
    pub(super) corners: Vec<DVec3>,
    /// Largest distance of a pixel from the centre, metres.
    pub(super) radius_m: f64,
    /// Whether the patch is a parallelogram, or a sector small enough to be treated as one.
    pub(super) flat: bool,
}

impl Patch {
    pub(super) fn new(grid: &ImageGrid, rectangle: Rectangle) -> Self {
        let plane = grid.flat();
        let point = |(row, column)| rectangle.point_m(&plane, row, column);
        let centre = rectangle.centre_m(grid);
        let sides = [(0.0, 0.5), (0.5, 0.0), (0.5, 1.0), (1.0, 0.5)];
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
        let [sides, corners] = [sides, corners].map(|all| {
            let feet = all.map(point);
            match heights_m(grid, &rectangle) {
                None => feet.to_vec(),
                Some(heights) => heights
                    .iter()
                    .flat_map(|&height| feet.map(|foot| foot + grid.normal() * height))
                    .collect(),
            }
        });
        let farthest = corners.iter().chain(&sides).map(|p| p.distance(centre));
        let span_rad = rectangle.size.columns as f64 * grid.columns.step.abs();
        let flat = !grid.polar || span_rad <= WIDEST_SECTOR_RAD;
        let mut radius_m = farthest.fold(0.0, f64::max);
        if !flat {
            // A sector lies within its outer radius of the pole.
            let outer_m = corners.iter().map(|p| p.distance(grid.origin_m));
            let outer_m = outer_m.fold(0.0, f64::max);
            radius_m = outer_m + centre.distance(grid.origin_m);
        }
        Self {
            centre,
            corners,
            radius_m,
            flat,
        }
    }

    /// Path differences between the corners and the centre for one pulse, metres.
    pub(super) fn offsets_m(&self, antennas: &Antennas) -> impl Iterator<Item = f64> {
        let centre_m = path_m(antennas, self.centre);
        let corners = self.corners.iter();
        corners.map(move |&corner| path_m(antennas, corner) - centre_m)
    }

    /// Largest path difference between a pixel and the centre for one pulse, metres.
    pub(super) fn depth_m(&self, antennas: &Antennas) -> f64 {
        // Triangle inequality, for both directions of the path.
        let most_m = 2.0 * self.radius_m;
        if !self.flat {
            return most_m;
        }
        let slope = |antenna: DVec3| (self.centre - antenna).normalize_or_zero();
        let slope = slope(antennas[0]) + slope(antennas[1]);
        let offsets_m = self.offsets_m(antennas).zip(&self.corners);
        let depths_m =
            offsets_m.map(|(above_m, corner)| above_m.max(-slope.dot(*corner - self.centre)));
        (depths_m.fold(0.0, f64::max) * MARGIN).min(most_m)
    }

    pub(super) fn distance_m(&self, [transmitter, receiver]: &Antennas) -> f64 {
        let transmitter_m = transmitter.distance(self.centre);
        transmitter_m.min(receiver.distance(self.centre))
    }
}

/// Range of surface heights above the grid plane in a rectangle, metres; `None` for a plane.
fn heights_m(grid: &ImageGrid, rectangle: &Rectangle) -> Option<[f64; 2]> {
    let relief = grid.relief.as_ref()?;
    if grid.polar {
        return Some(relief.range_m());
    }
    let ends =
        |axis: &Axis, first: usize, count: usize| [axis.at(first), axis.at(first + count - 1)];
    let x_m = ends(&grid.columns, rectangle.column, rectangle.size.columns);
    let y_m = ends(&grid.rows, rectangle.row, rectangle.size.rows);
    Some(relief.range_over_m(x_m, y_m))
}
