//! Phase gradient of an image per pixel, from the acquisition geometry.
//!
//! In an image formed here ([`subaperture_focus`]) the phase of a point at `q` is that of its echo at the
//! pixel `p = q`, and near it `2 pi (path(p) - path(q)) / lambda`, averaged over the aperture; for a monostatic radar
//! at `a`, `path = 2 |p - a|`. That is many turns per pixel, and the pixels determine it only modulo one
//! turn. The antenna at the aperture's centre and the centre wavelength resolve the
//! ambiguity.
//!
//! Neglected: the mean line of sight of an aperture of angle `A` differs from that of its centre by at most `A^2 / 8`
//! of its length; that of two antennas separated by the bistatic angle `B` differs from that of their midpoint
//! by at most `B / 2`. Where this can amount to a quarter of a turn per pixel, the result is `None`.

use std::f64::consts::TAU;

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;

/// Antenna position and wavelength that define an image's phase gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    /// Antenna at the aperture's centre, metres, scene frame.
    pub antenna_m: DVec3,
    /// Wavelength at the band centre, metres.
    pub wavelength_m: f64,
    /// Relative uncertainty of the phase gradient.
    uncertainty: f64,
}

/// Acquisition geometry, as in [`subaperture_model::resolution::survey::Survey`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
pub struct Geometry {
    /// Point that the angles and range refer to, metres, scene frame.
    pub scene_centre_m: [f64; 3],
    /// Slant range to the antenna, metres.
    pub slant_range_m: f64,
    /// Grazing angle, degrees.
    pub grazing_angle_deg: f64,
    /// Azimuth of the antenna, degrees from x towards y.
    pub azimuth_deg: f64,
    /// Aperture angle, degrees.
    pub aperture_angle_deg: f64,
    /// Bistatic angle, degrees.
    pub bistatic_angle_deg: f64,
    /// Wavelength at the band centre, metres.
    pub wavelength_m: f64,
}

impl Carrier {
    /// Carrier of a monostatic radar at `antenna_m` with a negligible aperture angle.
    pub fn new(antenna_m: DVec3, wavelength_m: f64) -> Self {
        Self {
            antenna_m,
            wavelength_m,
            uncertainty: 0.0,
        }
    }

    /// Carrier of an acquisition.
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

    /// Phase gradient at a position of `grid`, radians per row and per column; `None` if its uncertainty
    /// exceeds a quarter of a turn.
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
        // A relative error of the direction changes the gradient by that fraction of a pixel's whole path.
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

    /// Radar at 5 km along the y axis, wavelength 3 cm.
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
    fn phase_gradient_agrees_with_hand_calculation() {
        let carrier = Carrier::of(&SEEN);
        assert!(carrier.antenna_m.distance(DVec3::new(10.0, -5000.0, 0.0)) < 1e-9);
        let grid: ImageGrid = "x=-10:10:0.5,y=-10:10:0.3".parse().unwrap();
        // A row is 0.6 m of path, 20 turns; 3 m from the foot of the range, a column is
        // 0.5 m times 2 3 / 5000 of path: 0.02 turns.
        let [row, column] = carrier.turn(&grid, 0.0, 13.0).unwrap();
        assert!((row - 20.0 * TAU).abs() < 1e-4, "{row}");
        assert!((column - 0.02 * TAU).abs() < 1e-6, "{column}");
        // Half of that at a grazing angle of 60 degrees; along x for an antenna in the east.
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
    fn uncertain_phase_gradient_is_none() {
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
