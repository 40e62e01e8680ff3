//! Small rectangles of a Cartesian grid as kernels form them, paths by polynomials, and what that costs of accuracy
//! ([`subaperture_kernels::tile`]).

use std::f64::consts::TAU;

use crate::patch::Rectangle;
use subaperture_kernels::paths::Antennas;
use subaperture_kernels::tile::{PHASOR_RMS, PLACE_RMS, Raster, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Pulse;

/// The pixels of a rectangle; of a Cartesian grid.
pub(crate) fn raster(grid: &ImageGrid, rectangle: &Rectangle) -> Raster {
    Raster {
        centre_m: rectangle.centre_m(grid).to_array(),
        along_m: (grid.x_axis * grid.columns.step).to_array(),
        across_m: (grid.y_axis * grid.rows.step).to_array(),
        rows: rectangle.size.rows,
        columns: rectangle.size.columns,
    }
}

/// What a pulse's paths are measured from.
pub(crate) fn pulse_antennas(pulse: &Pulse) -> Antennas {
    Antennas {
        transmitter_m: pulse.transmitter_m.to_array(),
        receiver_m: pulse.receiver_m.to_array(),
        datum_m: pulse.reference_path_m,
    }
}

/// Looks at pulses from a tile, for profiles of `length` bins: whether the polynomials of its paths turn terms by no more than this
/// RMS phase.
pub(crate) fn fits(
    tile: &mut TileScratch,
    length: usize,
    pulses: &[TilePulse],
    raster: &Raster,
    highest_hz: f64,
    phase_rad: f64,
) -> bool {
    let off_m = tile.look(length, pulses, raster);
    TAU * highest_hz / SPEED_OF_LIGHT_M_S * off_m <= phase_rad
}

/// Relative RMS error of phasors and of places in float32, with profiles of at least so many bins a metre of path.
pub(crate) fn arithmetic(highest_hz: f64, bins_m: f64) -> f64 {
    let turns = highest_hz / SPEED_OF_LIGHT_M_S * PLACE_RMS / bins_m;
    libm::hypot(PHASOR_RMS, TAU * turns)
}
