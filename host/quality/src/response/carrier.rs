//! How fast an image's phase turns from pixel to pixel, from where it was seen.
//!
//! In an image of these formers ([`subaperture_focus`]) the phase of a point at `q` is that of its echo at the
//! pixel `p = q`, and near it `2 pi (path(p) - path(q)) / lambda`, averaged over the aperture: for a radar
//! at `a`, `path = 2 |p - a|`. That is many turns a pixel, and the pixels themselves tell it up to whole turns
//! only. With the antenna at the middle of the aperture and the band's middle wavelength it is known
//! well enough to tell how many.
//!
//! Neglected: the mean line of sight of an aperture of angle `A` is not that of its middle, by at most `A^2 / 8`
//! of its length, nor is that of two antennas `B` apart, seen from the scene, that of the middle between them,
//! by at most `B / 2`. Where that can come to a quarter of a turn a pixel, there is no answer.

use std::f64::consts::TAU;

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;

/// Where an image was seen from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    /// The antenna at the middle of the aperture, metres in the scene frame.
    pub antenna_m: DVec3,
    /// Wavelength at the middle of the band, metres.
    pub wavelength_m: f64,
    /// Part of the phase's turn by which it may be wrong.
    uncertainty: f64,
}

/// The geometry of a collection, as [`subaperture_resolution::survey::Survey`] has it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
pub struct Geometry {
    /// Point that the rest is seen from, metres in the scene frame.
    pub scene_centre_m: [f64; 3],
    /// Distance to the antenna, metres.
    pub slant_range_m: f64,
    /// Elevation of the antenna, degrees.
    pub grazing_angle_deg: f64,
    /// Direction to the antenna, degrees from x towards y.
    pub azimuth_deg: f64,
    /// Angle of the aperture, degrees.
    pub aperture_angle_deg: f64,
    /// Angle between transmitter and receiver, degrees.
    pub bistatic_angle_deg: f64,
    /// Wavelength at the middle of the band, metres.
    pub wavelength_m: f64,
}

impl Carrier {
    /// That of a radar at `antenna_m` with an aperture of no angle.
    pub fn new(antenna_m: DVec3, wavelength_m: f64) -> Self {
        Self {
            antenna_m,
            wavelength_m,
            uncertainty: 0.0,
        }
    }

    /// That of a collection.
    pub fn of(seen: &Geometry) -> Self {
        let (up, across) = seen.grazing_angle_deg.to_radians().sin_cos();
        let (y, x) = seen.azimuth_deg.to_radians().sin_cos();
        let to_antenna = DVec3::new(across * x, across * y, up);
        let aperture_rad = seen.aperture_angle_deg.to_radians();
        let bistatic_rad = seen.bistatic_angle_deg.to_radians();
        Self {
            antenna_m: DVec3::from_array(seen.scene_centre_m) + to_antenna * seen.slant_range_m,
            wavelength_m: seen.wavelength_m,
            uncertainty: aperture_rad.powi(2) / 8.0 + bistatic_rad / 2.0,
        }
    }

    /// Radians by which the phase turns a row and a column, at a place of `grid`; `None` if
    /// that is not known to a quarter of a turn.
    pub fn turn(&self, grid: &ImageGrid, row_value: f64, column_value: f64) -> Option<[f64; 2]> {
        let path_m = |rows: f64, columns: f64| {
            let point = grid.point_m(
                row_value + rows * grid.rows.step,
                column_value + columns * grid.columns.step,
            );
            2.0 * point.distance(self.antenna_m)
        };
        let turns = [
            path_m(0.5, 0.0) - path_m(-0.5, 0.0),
            path_m(0.0, 0.5) - path_m(0.0, -0.5),
        ]
        .map(|path_m| path_m / self.wavelength_m);
        // A direction that is wrong moves the turn by as much of a whole pixel's path.
        let steps = [grid.rows.step, grid.columns.step];
        let steps_m = match grid.polar {
            true => [steps[0], steps[1] * row_value.abs()],
            false => steps,
        };
        let known = steps_m
            .iter()
            .all(|step_m| 2.0 * step_m / self.wavelength_m * self.uncertainty < 0.25);
        (known && turns.iter().all(|turn| turn.is_finite())).then(|| turns.map(|turn| turn * TAU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A radar 5 km down the y axis, at 3 cm.
    const SEEN: Geometry = Geometry {
        scene_centre_m: [10.0, 0.0, 0.0],
        slant_range_m: 5000.0,
        grazing_angle_deg: 0.0,
        azimuth_deg: -90.0,
        aperture_angle_deg: 1.5,
        bistatic_angle_deg: 0.0,
        wavelength_m: 0.03,
    };

    #[test]
    fn turns_by_hand() {
        let carrier = Carrier::of(&SEEN);
        assert!(carrier.antenna_m.distance(DVec3::new(10.0, -5000.0, 0.0)) < 1e-9);
        let grid: ImageGrid = "x=-10:10:0.5,y=-10:10:0.3".parse().unwrap();
        // A row is 0.6 m of path, 20 turns; at 3 m from the foot of the range, a column is
        // 0.5 m times 2 3 / 5000 of path: 0.02 turns.
        let [row, column] = carrier.turn(&grid, 0.0, 13.0).unwrap();
        assert!((row - 20.0 * TAU).abs() < 1e-4, "{row}");
        assert!((column - 0.02 * TAU).abs() < 1e-6, "{column}");
        // Half of that from above at 60 degrees; and along x from the east.
        let above = Carrier::of(&Geometry {
            grazing_angle_deg: 60.0,
            azimuth_deg: 0.0,
            ..SEEN
        });
        let [row, column] = above.turn(&grid, 0.0, 10.0).unwrap();
        assert!(row.abs() < 1e-3, "{row}");
        assert!((column + 0.5 / 0.03 * TAU).abs() < 1e-3, "{column}");
    }

    #[test]
    fn what_is_not_known_is_not_said() {
        let grid: ImageGrid = "x=-10:10:0.5,y=-10:10:0.3".parse().unwrap();
        let turn = |seen: Geometry| Carrier::of(&seen).turn(&grid, 0.0, 0.0);
        assert!(turn(SEEN).is_some());
        let wide = Geometry {
            aperture_angle_deg: 90.0,
            ..SEEN
        };
        assert_eq!(turn(wide), None);
        let apart = Geometry {
            bistatic_angle_deg: 30.0,
            ..SEEN
        };
        assert_eq!(turn(apart), None);
        let silent = Geometry {
            wavelength_m: 0.0,
            ..SEEN
        };
        assert_eq!(turn(silent), None);
    }
}
