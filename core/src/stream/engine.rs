//! Arithmetic engine of the stream processor: float32 or fixed point.

use super::{Capacity, MapSamples, Patch, Setup};
use crate::{LengthError, Pulse};

/// Input of an [`Engine`]: one patch of one sub-CPI.
#[derive(Clone, Copy, Debug)]
pub struct Work<'a, S> {
    /// Settings of the run, already checked.
    pub setup: &'a Setup,
    /// Patch to form a map of, already checked against the setup.
    pub patch: &'a Patch,
    /// Fast-time window weights, one per frequency. They sum to 1.
    pub weights: &'a [f32],
    /// Pulses of one channel in the sub-CPI, `M >= 1`.
    pub pulses: &'a [Pulse],
    /// Samples of all pulses, `[M][F]`, pulses outermost.
    pub samples: &'a [S],
}

/// Arithmetic that forms one map in steps of bounded duration, so that a processor can serve its link between
/// steps. Call order: [`Engine::begin`], [`Engine::column`] for every frequency in ascending order,
/// [`Engine::row`] for every Doppler bin in ascending order, then [`Engine::map`].
///
/// No method may panic, whatever the samples.
pub trait Engine {
    /// Type of a stored sample.
    type Sample: Copy;

    /// Checks that the engine's buffers are large enough for `capacity`.
    ///
    /// # Errors
    /// [`LengthError`] naming the first buffer that is too short.
    fn holds(&self, capacity: &Capacity) -> Result<(), LengthError>;

    /// Prepare a patch: compute the motion-compensation phase of every pulse.
    fn begin(&mut self, work: &Work<'_, Self::Sample>);

    /// Compensate frequency `k` to the patch centre and transform it to Doppler (keystone).
    fn column(&mut self, work: &Work<'_, Self::Sample>, k: usize);

    /// Transform Doppler row `row` to range and keep the range gate. Row 0 is the lowest Doppler bin.
    fn row(&mut self, work: &Work<'_, Self::Sample>, row: usize);

    /// Samples of the map. Rows not yet processed are invalid.
    fn map(&self, work: &Work<'_, Self::Sample>) -> MapSamples<'_>;

    /// Number of arithmetic results that saturated since construction. Always 0 in floating point.
    fn saturated(&self) -> u32;
}
