//! Devices that backproject range profiles, such as a GPU: the interface between the former [`crate::bp`] and `subaperture-gpu`.
//!
//! The former makes range profiles, decides which tiles a block of pulses suits, and adds the others on the processor.

use std::fmt;

use num_complex::Complex32;

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
}
