//! Interface between the link and an odometer of any size.

use subaperture_core::link::{Encoding, complex32s, sc16s};
use subaperture_core::motion::{Antennas, Odometer, Progress, SampleError, Setup, SetupError};

/// Odometer that accepts samples in the link's encodings.
pub trait WireOdometer: Send {
    /// As [`Odometer::configure`].
    ///
    /// # Errors
    /// [`SetupError`].
    fn configure(&mut self, setup: &Setup, antennas: &Antennas<'_>) -> Result<(), SetupError>;

    /// Number of channels per pulse, as [`Odometer::channels`].
    fn channels(&self) -> usize;

    /// As [`Odometer::start`].
    fn start(&mut self, first: u32) -> bool;

    /// As [`Odometer::stop`].
    fn stop(&mut self);

    /// As [`Odometer::pulse`].
    fn pulse(&self) -> u32;

    /// As [`Odometer::incomplete`].
    fn incomplete(&self) -> u32;

    /// Like [`Odometer::push`], from the bytes of a message. An incomplete sample at the end is an error of length.
    ///
    /// # Errors
    /// [`SampleError`].
    fn push(
        &mut self,
        pulse: u32,
        channel: usize,
        reference_path_m: f64,
        encoding: Encoding,
        samples: &[u8],
    ) -> Result<(), SampleError>;

    /// As [`Odometer::work`].
    fn work(&mut self) -> Progress;
}

impl<const T: usize, const C: usize, const F: usize, const B: usize> WireOdometer
    for Odometer<T, C, F, B>
{
    fn configure(&mut self, setup: &Setup, antennas: &Antennas<'_>) -> Result<(), SetupError> {
        Self::configure(self, setup, antennas)
    }

    fn channels(&self) -> usize {
        Self::channels(self)
    }

    fn start(&mut self, first: u32) -> bool {
        Self::start(self, first)
    }

    fn stop(&mut self) {
        Self::stop(self);
    }

    fn pulse(&self) -> u32 {
        Self::pulse(self)
    }

    fn incomplete(&self) -> u32 {
        Self::incomplete(self)
    }

    fn push(
        &mut self,
        pulse: u32,
        channel: usize,
        reference_path_m: f64,
        encoding: Encoding,
        samples: &[u8],
    ) -> Result<(), SampleError> {
        if !samples.len().is_multiple_of(encoding.sample_bytes()) {
            return Err(SampleError::Length);
        }
        match encoding {
            Encoding::Complex32 => {
                Self::push(self, pulse, channel, reference_path_m, complex32s(samples))
            }
            Encoding::Sc16 => {
                let samples = sc16s(samples).map(|sample| sample.to_complex32());
                Self::push(self, pulse, channel, reference_path_m, samples)
            }
        }
    }

    fn work(&mut self) -> Progress {
        Self::work(self)
    }
}
