//! What the processor asks of an arithmetic: floating point or fixed point.

use super::{MapSamples, Patch, Setup};
use crate::Pulse;

/// One patch of one sub-CPI: what an engine computes a map of.
#[derive(Clone, Copy, Debug)]
pub struct Work<'a, S> {
    /// The run's settings; checked.
    pub setup: &'a Setup,
    /// The patch; checked against the setup.
    pub patch: &'a Patch,
    /// Fast-time weights, one a frequency; they sum to 1.
    pub weights: &'a [f32],
    /// The sub-CPI's pulses, `M` of them, at least 1.
    pub pulses: &'a [Pulse],
    /// Their samples, pulse by pulse, `F` each.
    pub samples: &'a [S],
}

/// The arithmetic of a map, in units of bounded work so that a processor can see to its link between
/// them: [`Engine::begin`], then [`Engine::column`] for every frequency in ascending order, then
/// [`Engine::row`] for every Doppler bin in ascending order; then [`Engine::map`].
///
/// None of them may panic, whatever the samples.
pub trait Engine {
    /// A stored sample.
    type Sample: Copy;

    /// Prepares the patch: phases of every pulse.
    fn begin(&mut self, work: &Work<'_, Self::Sample>);

    /// Compensates frequency `k` to the patch's centre and transforms it to Doppler.
    fn column(&mut self, work: &Work<'_, Self::Sample>, k: usize);

    /// Transforms Doppler row `row` (0 is the lowest) to range, and keeps the gate.
    fn row(&mut self, work: &Work<'_, Self::Sample>, row: usize);

    /// The map's samples; those of the rows done so far.
    fn map(&self, work: &Work<'_, Self::Sample>) -> MapSamples<'_>;

    /// Arithmetic results that had to be clamped since the beginning; none in floating point.
    fn saturated(&self) -> u32;
}
