//! Tiles of a Cartesian grid with polynomial paths, and their accuracy
//! ([`subaperture_kernels::tile`]).

use std::f64::consts::TAU;

use crate::patch::Rectangle;
use subaperture_kernels::paths::Antennas;
use subaperture_kernels::tile::{PHASOR_RMS, PLACE_RMS, Raster, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Pulse;

/// Pixel raster of a rectangle of a Cartesian grid.
pub(crate) fn raster(grid: &ImageGrid, rectangle: &Rectangle) -> Raster {
    Raster {
        centre_m: rectangle.centre_m(grid).to_array(),
        along_m: (grid.x_axis * grid.columns.step).to_array(),
        across_m: (grid.y_axis * grid.rows.step).to_array(),
        rows: rectangle.size.rows,
        columns: rectangle.size.columns,
    }
}

/// Antenna positions and reference path of a pulse.
pub(crate) fn pulse_antennas(pulse: &Pulse) -> Antennas {
    Antennas {
        transmitter_m: pulse.transmitter_m.to_array(),
        receiver_m: pulse.receiver_m.to_array(),
        datum_m: pulse.reference_path_m,
    }
}

/// Check pulses against a tile, for profiles of `length` bins: whether the RMS phase error of its path polynomials is at most
/// the given value.
pub(crate) fn fits(
    tile: &mut TileScratch,
    length: usize,
    pulses: &[TilePulse],
    raster: &Raster,
    highest_hz: f64,
    phase_rad: f64,
) -> bool {
    rms_phase(highest_hz, tile.look(length, pulses, raster)) <= phase_rad
}

/// Phase of a path of `path_m` metres at the highest frequency, radians.
pub(crate) fn rms_phase(highest_hz: f64, path_m: f64) -> f64 {
    TAU * highest_hz / SPEED_OF_LIGHT_M_S * path_m
}

/// Relative RMS error of float32 phasors and positions, with profiles of at least `bins_m` bins per metre of path.
pub(crate) fn arithmetic(highest_hz: f64, bins_m: f64) -> f64 {
    let turns = highest_hz / SPEED_OF_LIGHT_M_S * PLACE_RMS / bins_m;
    libm::hypot(PHASOR_RMS, TAU * turns)
}
