//! Interface between the link and a range profiler of any size.

use subaperture_core::link::pairs;
use subaperture_core::sweep::{BurstError, Profiler, Setup, SetupError, SweepProfile};

/// Range profiler that accepts samples in the link's encoding.
pub trait WireProfiler: Send {
    /// As [`Profiler::configure`].
    ///
    /// # Errors
    /// [`SetupError`].
    fn configure(&mut self, setup: &Setup) -> Result<(), SetupError>;

    /// Like [`Profiler::set_weights`], from the bytes of a message.
    ///
    /// # Errors
    /// [`SetupError`].
    fn set_weights(&mut self, first: usize, weights: &[u8]) -> Result<(), SetupError>;

    /// As [`Profiler::start`].
    fn start(&mut self, first: u32) -> bool;

    /// As [`Profiler::stop`].
    fn stop(&mut self);

    /// As [`Profiler::sweep`].
    fn sweep(&self) -> u32;

    /// As [`Profiler::left_out`].
    fn left_out(&self) -> u32;

    /// Like [`Profiler::push`], from the bytes of a message. An incomplete sample at the end is an error of length.
    ///
    /// # Errors
    /// [`BurstError`].
    fn push(
        &mut self,
        sweep: u32,
        carrier: u16,
        first: u32,
        samples: &[u8],
    ) -> Result<(), BurstError>;

    /// As [`Profiler::finish`].
    ///
    /// # Errors
    /// [`BurstError`].
    fn finish(&mut self, sweep: u32) -> Result<SweepProfile<'_>, BurstError>;

    /// As [`Profiler::profile`].
    fn profile(&self) -> Option<SweepProfile<'_>>;
}

impl<const P: usize, const N: usize, const R: usize> WireProfiler for Profiler<P, N, R> {
    fn configure(&mut self, setup: &Setup) -> Result<(), SetupError> {
        Self::configure(self, setup)
    }

    fn set_weights(&mut self, first: usize, weights: &[u8]) -> Result<(), SetupError> {
        Self::set_weights(self, first, subaperture_core::link::f32s(weights))
    }

    fn start(&mut self, first: u32) -> bool {
        Self::start(self, first)
    }

    fn stop(&mut self) {
        Self::stop(self);
    }

    fn sweep(&self) -> u32 {
        Self::sweep(self)
    }

    fn left_out(&self) -> u32 {
        Self::left_out(self)
    }

    fn push(
        &mut self,
        sweep: u32,
        carrier: u16,
        first: u32,
        samples: &[u8],
    ) -> Result<(), BurstError> {
        match samples.len().is_multiple_of(8) {
            true => Self::push(self, sweep, carrier, first, pairs(samples)),
            false => Err(BurstError::Length),
        }
    }

    fn finish(&mut self, sweep: u32) -> Result<SweepProfile<'_>, BurstError> {
        Self::finish(self, sweep)
    }

    fn profile(&self) -> Option<SweepProfile<'_>> {
        Self::profile(self)
    }
}
