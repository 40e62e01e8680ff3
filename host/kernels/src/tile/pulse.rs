//! Parameters of a pulse for backprojection onto tiles and points.

use crate::paths::Antennas;

/// Parameters of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TilePulse {
    /// Antenna positions and datum of the paths.
    pub antennas: Antennas,
    /// Profile periods per metre of path: frequency step over the speed of light.
    pub turns_m: f64,
    /// Carrier cycles per profile bin.
    pub cycles_a_bin: f64,
}
