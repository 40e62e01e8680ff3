//! Carrier removal before an image is interpolated, and the bandwidth that remains.
//!
//! The phase of a point at `q` near the pixel `p` is `2 pi (path(p) - path(q)) / lambda`. It turns many times per pixel, so the image spectrum is an
//! aliased band. The image times
//!
//! ```text
//! exp(-2 pi i (path(p) / lambda + o_r row + o_c column)),   path(p) = |p - t| + |p - r|
//! ```
//!
//! with the antennas `t` and `r` of the middle look, is at baseband; the offsets `o` centre it at the scene centre. A windowed sinc
//! interpolates it, and the carrier is restored at the interpolated position: complex values on the map equal those that the image former would compute there.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::resolution::support::{Looks, path_gradient};

use crate::MapError;

/// Samples per side of a grid at which the slope of a relief is evaluated.
const SLOPES_SEEN: usize = 33;

/// Carrier of an image, and its baseband extent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carrier {
    transmitter_m: DVec3,
    receiver_m: DVec3,
    wavelength_m: f64,
    /// Centre frequency after removal of the path phase, cycles per row and per column.
    offset: [f64; 2],
    /// Half-width of the baseband spectrum, cycles per row and per column.
    pub(crate) band: [f64; 2],
}

impl Carrier {
    /// Carrier of an image on `grid` with these looks. The band is the widest at 3 x 3 positions of the grid, or at [`SLOPES_SEEN`] per side on a relief.
    ///
    /// # Errors
    /// [`MapError::Unseen`] if the looks give no band; [`MapError::Folded`] if the band exceeds the pixels' sampling rate.
    pub(crate) fn of(grid: &ImageGrid, looks: &Looks) -> Result<Self, MapError> {
        let middle = looks
            .looks()
            .get(looks.looks().len() / 2)
            .ok_or(MapError::Unseen)?;
        let wavelength_m = 2.0 * SPEED_OF_LIGHT_M_S / (middle.band_hz[0] + middle.band_hz[1]);
        let mut carrier = Self {
            transmitter_m: middle.transmitter_m,
            receiver_m: middle.receiver_m,
            wavelength_m,
            offset: [0.0; 2],
            band: [0.0; 2],
        };
        // Per axis, lowest and highest frequency relative to the carrier, cycles per pixel.
        let left = |carrier: &Self, parts: [f64; 2]| -> Result<[[f64; 2]; 2], MapError> {
            let at = |axis: &subaperture_model::geometry::Axis, part: f64| {
                axis.start + part * (axis.count - 1) as f64 * axis.step
            };
            let (row_value, column_value) = (at(&grid.rows, parts[0]), at(&grid.columns, parts[1]));
            let place = grid.point_m(row_value, column_value);
            let support = looks.at(place);
            let gradient =
                path_gradient(carrier.transmitter_m, carrier.receiver_m, place) / wavelength_m;
            let [across, up] = grid.directions(row_value, column_value);
            let mut found = [[0.0; 2]; 2];
            for (i, (direction, step)) in [(up, grid.rows.step), (across, grid.columns.step)]
                .into_iter()
                .enumerate()
            {
                let extent = support.extent(direction).ok_or(MapError::Unseen)?;
                let own = gradient.dot(direction);
                found[i] = extent.map(|cycles| (cycles - own) * step - carrier.offset[i]);
            }
            Ok(found)
        };
        let centre = left(&carrier, [0.5; 2])?;
        carrier.offset = centre.map(|[low, high]| 0.5 * (low + high));
        let seen = match grid.relief {
            None => 3,
            Some(_) => SLOPES_SEEN,
        };
        let parts: Vec<f64> = (0..seen).map(|i| i as f64 / (seen - 1) as f64).collect();
        for (row, column) in parts
            .iter()
            .flat_map(|r| parts.iter().map(move |c| (*r, *c)))
        {
            let found = left(&carrier, [row, column])?;
            for (band, [low, high]) in carrier.band.iter_mut().zip(found) {
                let widest = low.abs().max(high.abs());
                if !widest.is_finite() {
                    return Err(MapError::Unseen);
                }
                *band = band.max(widest);
            }
        }
        for (axis, band) in ["rows", "columns"].into_iter().zip(carrier.band) {
            if band >= 0.5 {
                let cycles = 2.0 * band;
                return Err(MapError::Folded { cycles, axis });
            }
        }
        Ok(carrier)
    }

    /// Carrier phasor at a point of the scene, which has this row and column.
    #[inline]
    pub(crate) fn at(&self, point_m: DVec3, [row, column]: [f64; 2]) -> Complex32 {
        let path_m = point_m.distance(self.transmitter_m) + point_m.distance(self.receiver_m);
        let turns = path_m / self.wavelength_m + self.offset[0] * row + self.offset[1] * column;
        let (sin, cos) = libm::sincos(TAU * (turns - turns.floor()));
        Complex32::new(cos as f32, sin as f32)
    }
}
