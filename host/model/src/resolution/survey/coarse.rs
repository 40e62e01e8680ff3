//! Grids whose steps exceed the resolution.

use glam::DVec2;

use super::{Survey, Widths};
use crate::geometry::ImageGrid;
use crate::phase_history::Collection;
use subaperture_signal::window::Window;

/// Axis of a grid whose step exceeds the resolution along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoarseAxis {
    /// Name of the axis: x (columns) or y (rows).
    pub name: &'static str,
    /// Distance between pixels in the middle of the grid, metres.
    pub step_m: f64,
    /// Half-power width of the response along the axis, metres.
    pub resolution_m: f64,
}

impl Survey {
    /// Axes of a grid with steps above the half-power width of the response: with the default window if it is used over
    /// fast and slow time, otherwise without windows. Widths are those at the scene centre, or at the middle of the grid if
    /// the scene centre is at the antennas.
    pub fn coarse_axes(
        &self,
        collection: &Collection,
        grid: &ImageGrid,
        windows: [Window; 2],
    ) -> Vec<CoarseAxis> {
        let (row, column) = (grid.rows.count / 2, grid.columns.count / 2);
        let at_grid = match self.centre_at_antennas {
            true => Self::at(collection, grid.position_m(row, column)),
            false => None,
        };
        let survey = at_grid.as_ref().unwrap_or(self);
        let widths = match windows == [Window::default(); 2] {
            true => &survey.half_power_windowed,
            false => &survey.half_power,
        };
        let along = grid.directions(grid.rows.at(row), grid.columns.at(column));
        let axes = [("x", &grid.columns), ("y", &grid.rows)];
        let axes = axes.into_iter().zip(along);
        axes.filter(|((_, axis), _)| axis.count > 1)
            .filter_map(|((name, axis), direction)| {
                let coarse = CoarseAxis {
                    name,
                    step_m: (direction * axis.step).length(),
                    resolution_m: widths.along(survey.azimuth_deg, direction.truncate())?,
                };
                (coarse.step_m > coarse.resolution_m).then_some(coarse)
            })
            .collect()
    }
}

impl Widths {
    /// Width along a direction in the scene plane, of an ellipse with axes along and across the line of sight.
    fn along(&self, azimuth_deg: f64, direction: DVec2) -> Option<f64> {
        let direction = direction.try_normalize()?;
        let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
        let range = DVec2::new(cos, sin);
        let part = |axis: DVec2, width_m: Option<f64>| {
            width_m.map_or(0.0, |width_m| direction.dot(axis) / width_m)
        };
        let along_range = part(range, self.range_m);
        let across = part(range.perp(), self.cross_range_m);
        let inverse = libm::hypot(along_range, across);
        (inverse > 0.0).then(|| 1.0 / inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen from 30 deg: along the line of sight the range width, across it the other, at 45 deg between them
    /// `1 / sqrt(1/2 / r^2 + 1/2 / c^2)`.
    #[test]
    fn width_along_direction_is_that_of_ellipse() {
        let widths = Widths {
            slant_range_m: None,
            range_m: Some(0.4),
            cross_range_m: Some(0.1),
        };
        for (turn_deg, expected) in [(0.0, 0.4), (90.0, 0.1), (45.0, 1.0 / 53.125f64.sqrt())] {
            let direction = DVec2::from_angle(f64::to_radians(30.0 + turn_deg)) * 3.0;
            let found = widths.along(30.0, direction).unwrap();
            assert!((found - expected).abs() < 1e-12, "{turn_deg}: {found}");
        }
        let unknown = Widths {
            range_m: None,
            cross_range_m: None,
            ..widths
        };
        assert_eq!(unknown.along(30.0, DVec2::X), None);
    }
}
