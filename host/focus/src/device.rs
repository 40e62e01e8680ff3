//! Devices that form pixels, such as a GPU: the interface between the formers [`crate::bp`] and [`crate::rdbp`] and `subaperture-gpu`.
//!
//! `bp` makes range profiles, decides which tiles a block of pulses suits, and adds the others on the processor. The precise mode of `rdbp` makes the range-Doppler maps of
//! patches, and the device interpolates them at the pixels.

use std::fmt;

use num_complex::Complex32;
use subaperture_signal::kaiser_bessel::TERMS;

pub use subaperture_kernels::patch_map::{
    Curve, DOPPLER_TAPS, Reading, Station, TAPS, pixel_stride,
};
pub use subaperture_kernels::tile::Expansion;

/// Device that adds pulses to tiles of pixels.
pub trait Device: fmt::Debug + Sync {
    /// Name for records and messages.
    fn name(&self) -> &str;

    /// Time per pixel and pulse, nanoseconds.
    fn pixel_ns(&self) -> f64;

    /// Sums over the pixels of tiles with the given numbers of rows and columns, all 0.
    ///
    /// # Errors
    /// [`DeviceError`] if the device has no memory for them.
    fn start<'a>(&'a self, tiles: &[[usize; 2]]) -> Result<Box<dyn TileSums + 'a>, DeviceError>;

    /// Sums over the pixels of a patch with the given numbers of stations and lines, all 0. Several threads have one each.
    ///
    /// # Errors
    /// [`DeviceError`] if the device has no memory for them.
    fn start_patch<'a>(
        &'a self,
        stations: usize,
        lines: usize,
    ) -> Result<Box<dyn PatchSums + 'a>, DeviceError>;
}

/// Sums over the pixels of a patch, held by a device.
pub trait PatchSums {
    /// Add a map, interpolated at the pixels: the last two steps of [`subaperture_kernels::patch_map`]. The error is at most [`map_rounding`] beyond that of the
    /// kernels. May return before the sums are complete.
    ///
    /// # Errors
    /// [`DeviceError`] if the device has no memory for the map.
    fn add(&mut self, map: &PatchMap) -> Result<(), DeviceError>;

    /// The sums, `[station][real, imaginary][pixel_stride(lines)]`.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn take(self: Box<Self>) -> Result<Vec<f32>, DeviceError>;
}

/// Interpolation kernel: for each tap of the first half, the polynomials of its even and odd part in the fraction minus a half.
pub type KernelPolynomials<'a> = &'a [[[f32; TERMS]; 2]];

/// Range-Doppler map of a patch and the positions of its pixels.
#[derive(Clone, Copy)]
pub struct PatchMap<'a> {
    /// Values, `[bin / 16][range bin][real, imaginary][16 bins]`.
    pub values: &'a [f32],
    /// Number of range bins, the period of the map.
    pub range_bins: usize,
    /// Number of the first Doppler bin.
    pub first_bin: isize,
    /// Kernels of [`TAPS`] taps in range and [`DOPPLER_TAPS`] in Doppler.
    pub kernels: [KernelPolynomials<'a>; 2],
    /// Positions of the pixels.
    pub reading: &'a Reading<'a>,
}

/// Sums over the pixels of tiles, held by a device.
pub trait TileSums: Send {
    /// Load the block of pulses that [`Self::add`] adds from now on.
    ///
    /// # Errors
    /// [`DeviceError`] if the device has no memory for the profiles.
    fn load(&mut self, block: &ProfileBlock) -> Result<(), DeviceError>;

    /// Add the loaded pulses to some of the tiles, given by their indices in ascending order:
    ///
    /// ```text
    /// sum[p] += sum_n exp(+j 2 pi kappa_n t_n(p)) value_n(t_n(p)),   t_n(p): paths of tile and pulse n, in bins
    /// ```
    ///
    /// `paths` has one expansion per tile and pulse, those of a tile one after another. The error is at most [`rounding`] per pulse. May return before
    /// the sums are complete.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn add(&mut self, tiles: &[usize], paths: &[Expansion]) -> Result<(), DeviceError>;

    /// Wait until everything has been added.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn wait(&mut self) -> Result<(), DeviceError>;

    /// The sums of all tiles, one tile after another, each row by row.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn take(self: Box<Self>) -> Result<Vec<Complex32>, DeviceError>;
}

/// Range profiles of some pulses as spline coefficients.
#[derive(Clone, Copy, Debug)]
pub struct ProfileBlock<'a> {
    /// Degree of the splines, 2 or 3.
    pub degree: usize,
    /// Bins per period of a profile.
    pub length: usize,
    /// Values before the first and after the last bin of each profile, which continue its period. Sufficient for every tile
    /// ([`subaperture_kernels::tile::Pieces::margin_for`]).
    pub margin: usize,
    /// Profiles times the weights of their pulses, `length + 2 margin` values per pulse.
    pub profiles: &'a [Complex32],
    /// Carrier cycles per bin, `kappa`, of each pulse.
    pub carriers: &'a [f64],
}

/// Failure of a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{device}: {message}")]
pub struct DeviceError {
    device: String,
    message: String,
}

impl DeviceError {
    /// Make an error of the named device.
    pub fn new(device: &str, message: impl Into<String>) -> Self {
        Self {
            device: device.to_owned(),
            message: message.into(),
        }
    }
}

/// Half the spacing of float32 numbers near 1.
const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// Error of the phasors of a device, with the fixed-point phase.
const PHASOR: f64 = 6e-7;

/// Bound on the relative RMS error of a pulse in a tile, apart from truncation of its path. Float32 are positions of up to `position` bins from the tile's centre, whose
/// errors displace a profile upsampled by `oversampling`, and phases of up to `bend` cycles beyond the linear ones, which are exact to 2^-25 cycles.
///
/// A value at the edge of the tile is rounded four times at most, with errors that partly cancel; values inside are smaller. Twice the rounding of the largest
/// value bounds their RMS.
pub fn rounding(position: f64, oversampling: f64, bend: f64) -> f64 {
    // The fastest component of a profile turns by pi / oversampling radians per bin.
    let slope = std::f64::consts::PI / oversampling;
    PHASOR + 2.0 * ROUNDING * (slope * position + std::f64::consts::TAU * bend)
}

/// Bound on the relative RMS error of the interpolation of a map in float32. Linear phases along the lines are exact to 2^-25 cycles; the others, up to `bend` cycles
/// ([`bend`]), are rounded twice in each of the four steps of their polynomial. Weights of the kernels and sums over them have errors of 1e-6.
pub fn map_rounding(bend: f64) -> f64 {
    PHASOR + 1e-6 + 8.0 * ROUNDING * std::f64::consts::TAU * bend
}

/// Largest phase of a station beyond the linear one, cycles.
pub fn bend(station: &Station) -> f64 {
    station.cycles[2..].iter().map(|term| term.abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_grows_with_position_and_bend() {
        assert_eq!(rounding(0.0, 3.0, 0.0), PHASOR);
        let small = rounding(100.0, 3.0, 1.0);
        assert!(small > 1.2e-5 && small < 1.6e-5, "{small}");
        assert!(rounding(200.0, 3.0, 1.0) > small && rounding(100.0, 3.0, 8.0) > small);
    }

    #[test]
    fn rounding_of_maps_grows_with_bend() {
        let station = Station {
            cycles: [1e5, -300.0, 2.0, -0.5, 0.0],
            ..Station::default()
        };
        assert_eq!(bend(&station), 2.5);
        let small = map_rounding(2.5);
        assert!(small > 2e-6 && small < 2e-5, "{small}");
        assert!(map_rounding(25.0) > 5.0 * small);
    }
}
