//! Parameters of a plan of backprojection.

use super::blurs::Blurs;
use crate::read_ahead::BLOCKS_HELD;

/// Pulses summed per pixel before they are added to it, if scratch memory has room for their profiles. The number is part of
/// the plan, so that the summation order does not depend on memory.
pub(super) const SUMMED_PULSES: usize = 64;

/// Pulses summed per pixel with intra-pulse motion, which takes many profiles per pulse.
pub(super) const SUMMED_BLURRED: usize = 16;

/// Largest upsampling factor; float32 limits the error to about -130 dB.
pub(super) const MAX_OVERSAMPLING: f64 = 4096.0;

/// Largest number of intervals beyond the ends of a profile.
pub(super) const MAX_MARGIN: usize = 1 << 18;

/// Largest number of partial sums computed at a time.
pub(super) const MAX_PARTS: usize = 4;

/// Parameters fixed by a plan.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    /// Degree of the splines that interpolate profiles.
    pub(super) degree: usize,
    /// Upsampling factor of range profiles.
    pub(super) oversampling: f64,
    /// Intervals beyond the ends of a profile.
    pub(super) margin: usize,
    /// Pulses summed per pixel before they are added to it.
    pub(super) summed_pulses: usize,
    /// Computation of pixel paths.
    pub(super) paths: PixelPaths,
}

/// Method for the paths of pixels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum PixelPaths {
    /// Exact path for each pixel.
    Points,
    /// Path polynomials over tiles of `side` x `side` pixels, used where their RMS phase error is at most `phase_rad`.
    Tiles { side: usize, phase_rad: f64 },
    /// Exact path and range rate for each pixel, for intra-pulse motion.
    Blurs(Blurs),
}

/// Bytes for a pulse, its buffered copies, and the given number of derived values.
pub(super) fn pulse_bytes(num_samples: usize, values: usize) -> u64 {
    (8 * BLOCKS_HELD * num_samples + 4 * values) as u64
}
