//! Rotation by multiples of 90 degrees, and flips, such that rows run away from the radar and the plane's normal points up.

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{ImageSource, ImageSourceError};

/// Orientation of a SICD's rows and columns relative to those of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orientation {
    /// Whether rows run along the image's column axis (transposed).
    pub crossed: bool,
    /// Whether rows, and columns, run against their axis (flipped).
    pub against: [bool; 2],
}

impl Orientation {
    /// Orientation with the normal on the side of `up` whose rows are best aligned with `away`.
    pub fn along(grid: &ImageGrid, away: DVec3, up: DVec3) -> Self {
        let mut best = (f64::NEG_INFINITY, Self::default());
        for bits in 0..8u8 {
            let turned = Self {
                crossed: bits & 1 != 0,
                against: [bits & 2 != 0, bits & 4 != 0],
            };
            let [row, column] = turned.directions(grid);
            let along = row.dot(away);
            if row.cross(column).dot(up) > 0.0 && along > best.0 {
                best = (along, turned);
            }
        }
        best.1
    }

    /// Directions of ascending rows and columns, unit vectors of the scene frame.
    pub fn directions(&self, grid: &ImageGrid) -> [DVec3; 2] {
        let sign = |against: bool| if against { -1.0 } else { 1.0 };
        let axes = match self.crossed {
            true => [grid.x_axis, grid.y_axis],
            false => [grid.y_axis, grid.x_axis],
        };
        [0, 1].map(|k| axes[k] * sign(self.against[k]))
    }

    /// Grid axes along rows and columns.
    pub(crate) fn axes(&self, grid: &ImageGrid) -> [Axis; 2] {
        match self.crossed {
            true => [grid.columns, grid.rows],
            false => [grid.rows, grid.columns],
        }
    }

    /// Rows and columns of the SICD of an image of this size.
    pub fn size(&self, (rows, columns): (usize, usize)) -> [usize; 2] {
        match self.crossed {
            true => [columns, rows],
            false => [rows, columns],
        }
    }

    /// Image row and column of a row and column of the SICD.
    pub fn of(&self, size: (usize, usize), [row, column]: [usize; 2]) -> [usize; 2] {
        let [rows, columns] = self.size(size);
        let flip = |n: usize, count: usize, against: bool| if against { count - 1 - n } else { n };
        let [a, b] = [
            flip(row, rows, self.against[0]),
            flip(column, columns, self.against[1]),
        ];
        if self.crossed { [b, a] } else { [a, b] }
    }

    /// Read rows `from..to` of the SICD from an image.
    ///
    /// # Errors
    /// [`ImageSourceError`] if the image cannot be read.
    pub fn rows(
        &self,
        image: &dyn ImageSource,
        from: usize,
        to: usize,
    ) -> Result<Vec<Complex32>, ImageSourceError> {
        let size = image.size();
        let [rows, columns] = self.size(size);
        let run = match self.against[0] {
            true => rows - to..rows - from,
            false => from..to,
        };
        let place = match self.crossed {
            true => [0..size.0, run],
            false => [run, 0..size.1],
        };
        let window = image.window(&place)?;
        let mut turned = Vec::with_capacity((to - from) * columns);
        for row in from..to {
            for column in 0..columns {
                let [r, c] = self.of(size, [row, column]);
                let at = (r - place[0].start) * window.columns + c - place[1].start;
                turned.push(window.pixels[at]);
            }
        }
        Ok(turned)
    }
}

impl Default for Orientation {
    /// Orientation of the image itself.
    fn default() -> Self {
        Self {
            crossed: false,
            against: [false; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::image::Image;

    #[test]
    fn rotated_rows_run_away_from_radar_and_samples_keep_positions() {
        let grid: ImageGrid = "x=0:4:1,y=10:13:1,z=0".parse().unwrap();
        let image = Image {
            rows: 3,
            columns: 4,
            pixels: (0..12u8).map(|n| Complex32::new(n.into(), 0.0)).collect(),
        };
        for (away, expected) in [
            (DVec3::X, [DVec3::X, DVec3::Y]),
            (DVec3::NEG_X, [DVec3::NEG_X, DVec3::NEG_Y]),
            (DVec3::Y, [DVec3::Y, DVec3::NEG_X]),
            (DVec3::new(0.6, -0.7, -0.3), [DVec3::NEG_Y, DVec3::X]),
        ] {
            let turned = Orientation::along(&grid, away, DVec3::Z);
            assert_eq!(turned.directions(&grid), expected);
            let [rows, columns] = turned.size(image.size());
            let mut all = turned.rows(&image, 0, 1).unwrap();
            all.extend(turned.rows(&image, 1, rows).unwrap());
            let first = turned.of(image.size(), [0, 0]);
            let start = grid.position_m(first[0], first[1]);
            for row in 0..rows {
                for column in 0..columns {
                    // Position from the directions of rows and columns.
                    let there = start + expected[0] * row as f64 + expected[1] * column as f64;
                    let [r, c] = turned.of(image.size(), [row, column]);
                    assert!(grid.position_m(r, c).distance(there) < 1e-12);
                    assert_eq!(all[row * columns + column], image.pixels[r * 4 + c]);
                }
            }
        }
    }
}
