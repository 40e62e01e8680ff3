//! Coherent accumulation (backprojection of maps): every pixel interpolates every map at its range and Doppler.
//!
//! **Equation** (Schone 2020, section 3.2 and (3.15)). Let `P` be the pixel's path relative to the reference and
//! `P'` its rate per pulse, both at the centre `(M - 1)/2` of the sub-CPI, and let
//! `P0 = P + P' (M/2 - (M - 1)/2)` be the path at the map's reference pulse `M/2`, half a pulse later for even
//! `M` and equal for odd `M`:
//!
//! ```text
//! pixel += weight  map[D/2 - D f_ref P' / c][R/2 + R step_hz P0 / c]  exp(+j 2 pi f_ref P0 / c)
//! ```
//! The map is interpolated bilinearly. The exponential contains the range phase (`P`) and the Doppler phase
//! (`P'` times half a pulse).
//!
//! **Neglected**: curvature of the path within the sub-CPI, a phase of up to `(pi/4) (f_ref/c) |P''| M^2` at its
//! ends, and the interpolation error of [`crate::Map::bilinear`]. Pixels outside a map receive nothing from it.
//!
//! **Input**: a map normalised so that a scatterer of unit amplitude has the value 1. **Output**: pixels, row-major;
//! with weights that sum to 1 over the sub-CPIs a unit scatterer has amplitude 1. **Cost**: 8 bytes per pixel; per pixel
//! and map two float64 square roots, one phasor and four complex reads: 490 instructions under QEMU's Cortex-M7,
//! 7.8 k without float64 hardware. **Accuracy**: geometry and phase in float64 to about 1e-9 turns at 1e6
//! wavelengths of path. `tests/stream/accumulate.rs` verifies that a simulated point has amplitude 1 within the bound
//! above, phase included.

use num_complex::Complex32;

use super::{Centre, PixelGrid};
use crate::{LengthError, Map, SPEED_OF_LIGHT_M_S, Turns};

/// Add `weight` times a map to the pixels of `grid`. Returns the number of pixels inside the map.
///
/// ```
/// use subaperture_core::accumulate::{Centre, PixelGrid, add_map};
/// use subaperture_core::{Axes, Complex32, Map, Shape};
///
/// let grid = PixelGrid {
///     origin_m: [0.0, 1000.0, 0.0],
///     column_step_m: [1.0, 0.0, 0.0],
///     row_step_m: [0.0, 1.0, 0.0],
///     num_columns: 3,
///     num_rows: 2,
/// };
/// // A map of ones, referenced to the first pixel's path: there it has the value 1 with phase 0.
/// let shape = Shape { num_pulses: 4, num_frequencies: 4, num_range_bins: 4, num_doppler_bins: 4 };
/// let ones = [Complex32::ONE; 16];
/// let map = Map::new(Axes::new(shape, 1.0e9, 1.0e6)?, &ones)?;
/// let centre = Centre::monostatic([0.0; 3], [0.1, 0.0, 0.0], [0.0, 1000.0, 0.0]);
/// let mut pixels = [Complex32::ZERO; 6];
/// assert_eq!(add_map(&mut pixels, &grid, &map, &centre, 1.0)?, 6);
/// assert_eq!(pixels[0], Complex32::ONE);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`LengthError`] if `pixels` does not have one element per pixel of the grid. Nothing is then written.
pub fn add_map(
    pixels: &mut [Complex32],
    grid: &PixelGrid,
    map: &Map<'_>,
    centre: &Centre,
    weight: f32,
) -> Result<usize, LengthError> {
    let axes = map.axes();
    let shape = axes.shape();
    let wavenumber = axes.centre_hz() / SPEED_OF_LIGHT_M_S; // cycles a metre of path
    let late_by = (shape.num_pulses / 2) as f64 - (shape.num_pulses - 1) as f64 / 2.0; // 1/2 or 0
    let (doppler_bins, range_bins) = (shape.num_doppler_bins, shape.num_range_bins);
    add_pixels(pixels, grid, |point_m| {
        let (path, rate) = centre.relative_path_m(point_m);
        let path = path + rate * late_by;
        let doppler = (doppler_bins / 2) as f64 - doppler_bins as f64 * wavenumber * rate;
        let range = (range_bins / 2) as f64 + axes.range_bins_per_metre() * path;
        let value = map.bilinear(doppler, range)?;
        Some(value * (Turns::from_f64(wavenumber * path).phasor() * weight))
    })
}

/// Add `value_at` of its position to every pixel. Returns the number of pixels that have a value.
pub(super) fn add_pixels(
    pixels: &mut [Complex32],
    grid: &PixelGrid,
    value_at: impl Fn([f64; 3]) -> Option<Complex32>,
) -> Result<usize, LengthError> {
    let expected = grid.num_pixels().unwrap_or(usize::MAX);
    LengthError::check("pixels", expected, pixels.len())?;
    let mut inside = 0;
    // Rows without columns have no pixels, so any width works.
    let width = grid.num_columns.max(1);
    for (row, line) in pixels.chunks_exact_mut(width).enumerate() {
        for (column, pixel) in line.iter_mut().enumerate() {
            if let Some(value) = value_at(grid.position_m(row, column)) {
                *pixel += value;
                inside += 1;
            }
        }
    }
    Ok(inside)
}
