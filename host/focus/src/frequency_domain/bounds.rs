//! Bounds of the pixel positions along and across a track without evaluating every pixel.
//!
//! From pixel to pixel, along-track position and distance from the line change by at most the pixel spacing. All pixels of a
//! rectangle therefore lie within its radius of the centre pixel. A rectangle that cannot extend the known bounds is skipped;
//! others are divided into quarters. The result is identical to an evaluation of all pixels, with work proportional to the sides of the grid
//! rather than its area.

use std::ops::Range;

use crate::straight_track::StraightTrack;
use subaperture_model::geometry::ImageGrid;

/// Largest side of a rectangle, pixels, whose pixels are all evaluated.
const FEW: usize = 4;
/// Largest side of a grid, pixels, with exact bounds; bounds of larger grids are widened by this fraction of their extent.
const MAX_LOOKED_INTO: usize = 1 << 20;
const FINE: f64 = 1e-5;
/// Margin for rounding of positions, relative to their distance, and for axes that are orthonormal to 1e-6.
const SLACK: f64 = 1e-9;
const ORTHONORMAL: f64 = 1.0 + 1e-5;

/// Smallest and largest coordinates of pixels, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    /// Along-track position, metres.
    pub(super) along_m: [f64; 2],
    /// Distance from the line of the track, metres.
    pub(super) range_m: [f64; 2],
}

impl Bounds {
    const NONE: Self = Self {
        along_m: [f64::INFINITY, f64::NEG_INFINITY],
        range_m: [f64::INFINITY, f64::NEG_INFINITY],
    };

    /// Bounds of all pixels of `grid`.
    pub(super) fn of(track: &StraightTrack, grid: &ImageGrid) -> Self {
        let mut bounds = Self::NONE;
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        for (row, column) in [
            (0, 0),
            (0, columns - 1),
            (rows - 1, 0),
            (rows - 1, columns - 1),
        ] {
            bounds.look(track, grid, row, column);
        }
        let huge = rows.max(columns) > MAX_LOOKED_INTO;
        let far_m = grid.origin_m.length() + track.centre_m.length();
        let mut left = vec![[0..rows, 0..columns]];
        while let Some([rows, columns]) = left.pop() {
            if rows.len() <= FEW && columns.len() <= FEW {
                for row in rows {
                    for column in columns.clone() {
                        bounds.look(track, grid, row, column);
                    }
                }
                continue;
            }
            let middle = [middle(&rows), middle(&columns)];
            let place = bounds.look(track, grid, middle[0], middle[1]);
            let reach_m = radius_m(grid, middle, [&rows, &columns]) + SLACK * far_m;
            if huge && reach_m < FINE * bounds.extent_m() {
                bounds.widen_about(place, reach_m);
            } else if !bounds.hold(place, reach_m) {
                let halves =
                    |range: Range<usize>, middle: usize| [range.start..middle, middle..range.end];
                for rows in halves(rows, middle[0]) {
                    let columns = halves(columns.clone(), middle[1]);
                    let parts = columns.map(|columns| [rows.clone(), columns]);
                    left.extend(
                        parts
                            .into_iter()
                            .filter(|part| part.iter().all(|side| !side.is_empty())),
                    );
                }
            }
        }
        bounds
    }

    /// Extend the bounds by a pixel; return its coordinates.
    fn look(
        &mut self,
        track: &StraightTrack,
        grid: &ImageGrid,
        row: usize,
        column: usize,
    ) -> [f64; 2] {
        let (x, r) = track.along_and_range_m(grid.position_m(row, column));
        let widen = |bounds: &mut [f64; 2], value: f64| {
            *bounds = [bounds[0].min(value), bounds[1].max(value)];
        };
        widen(&mut self.along_m, x);
        widen(&mut self.range_m, r);
        [x, r]
    }

    /// Larger extent of the two axes, metres.
    fn extent_m(&self) -> f64 {
        let span = |[low, high]: [f64; 2]| high - low;
        span(self.along_m).max(span(self.range_m))
    }

    /// Extend the bounds by a circle around a position.
    fn widen_about(&mut self, [x, r]: [f64; 2], radius_m: f64) {
        let widen = |bounds: &mut [f64; 2], value: f64| {
            *bounds = [
                bounds[0].min(value - radius_m),
                bounds[1].max(value + radius_m),
            ];
        };
        widen(&mut self.along_m, x);
        widen(&mut self.range_m, r);
        self.range_m[0] = self.range_m[0].max(0.0);
    }

    /// Whether a circle around a position lies within the bounds.
    fn hold(&self, [x, r]: [f64; 2], radius_m: f64) -> bool {
        let reach_m = radius_m + SLACK * (x.abs() + r.abs());
        let within =
            |[low, high]: [f64; 2], value: f64| value - reach_m >= low && value + reach_m <= high;
        within(self.along_m, x) && within(self.range_m, r)
    }
}

fn middle(range: &Range<usize>) -> usize {
    range.start + range.len() / 2
}

/// Largest distance of a pixel of a rectangle from its centre pixel, metres.
fn radius_m(grid: &ImageGrid, middle: [usize; 2], [rows, columns]: [&Range<usize>; 2]) -> f64 {
    let farthest = |range: &Range<usize>, middle: usize| {
        (middle - range.start).max(range.end - 1 - middle) as f64
    };
    let down = farthest(rows, middle[0]) * grid.rows.step.abs();
    let across = farthest(columns, middle[1]) * grid.columns.step.abs();
    let across_m = match grid.polar {
        true => {
            across
                * grid
                    .rows
                    .at(rows.start)
                    .abs()
                    .max(grid.rows.at(rows.end - 1).abs())
        }
        false => across,
    };
    ORTHONORMAL * (down + across_m)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn bounds_equal_those_of_all_pixels() {
        let track = |centre: DVec3, direction: DVec3| StraightTrack {
            centre_m: centre,
            direction: direction.normalize(),
            spacing_m: 0.1,
            num_pulses: 100,
        };
        let tracks = [
            track(DVec3::new(0.0, -4000.0, 3000.0), DVec3::X),
            track(DVec3::new(10.0, -40.0, 3.0), DVec3::new(0.7, 0.7, 0.1)),
            // A track over the pixels, and one through them.
            track(DVec3::new(1.0, 2.0, 50.0), DVec3::new(1.0, 0.2, 0.0)),
            track(DVec3::new(1.0, 2.0, 0.0), DVec3::new(0.0, 1.0, 0.3)),
        ];
        for grid in [
            "x=-30:30:0.7,y=-20:25:0.3,z=2",
            "x=0:1:1,y=0:3:1",
            "cx=5,cy=3,yaw=30,pitch=20,x=-9:9:0.1,y=-3:3:0.2",
            "r=20:60:0.5,theta=-80:95:0.9",
            "x=-1000:1000:2,y=-1000:1000:2",
        ] {
            let grid: ImageGrid = grid.parse().unwrap();
            for track in &tracks {
                let mut all = Bounds::NONE;
                for row in 0..grid.rows.count {
                    for column in 0..grid.columns.count {
                        all.look(track, &grid, row, column);
                    }
                }
                assert_eq!(Bounds::of(track, &grid), all);
            }
        }
    }
}
