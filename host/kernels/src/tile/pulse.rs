//! A pulse, as tiles and points take it.

use crate::paths::Antennas;

/// What a pulse contributes with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TilePulse {
    /// Where its paths are measured from.
    pub antennas: Antennas,
    /// Turns of the profile a metre of path: the step of frequency over the speed of light.
    pub turns_m: f64,
    /// Cycles of the carrier a bin of the profile.
    pub cycles_a_bin: f64,
}
