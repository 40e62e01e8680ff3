//! Front ends: sources of pulses on the module itself, in place of samples over the link.
//!
//! In a run started by [`Command::StartFrontEnd`](subaperture_core::link::Command::StartFrontEnd) the host sends the geometry of
//! each pulse ahead of time, and a [`FrontEnd`] provides the samples. Both carry the pulse number, so a pulse that either side
//! loses costs its sub-CPI and no other.
//!
//! | front end | input | pulse number |
//! |---|---|---|
//! | [`FrameStream`] | frames over any `embedded-io` port, such as those of a radar transceiver's processor | in the frame |
//! | [`SpiConverter`] | two-channel 16-bit converter on any `embedded-hal` SPI bus | count of pulses since the start of the run |
//!
//! **Tests**: `tests/link/front_end.rs` (mocks of `embedded-hal-mock`), `tests/firmware/front_end.rs` (emulated board).

pub mod frame;
mod spi;
mod stream;

use heapless::Deque;
use subaperture_core::Pulse;

pub use spi::{Coding, SpiConverter};
pub use stream::FrameStream;

/// Maximum number of pulses whose geometry waits for samples.
pub const MAX_AHEAD: usize = 32;

/// Geometry of the pulses to come, in the order of their numbers.
pub type GeometryQueue = Deque<Pulse, MAX_AHEAD>;

/// Source of pulse samples.
pub trait FrontEnd: Send {
    /// Maximum number of samples per pulse.
    fn max_samples(&self) -> usize;

    /// Begin a run whose first pulse has the number `first` and whose pulses have `num_samples` samples, at most
    /// [`FrontEnd::max_samples`].
    fn begin(&mut self, first: u32, num_samples: usize);

    /// Receive at most one pulse, and return the number and the samples of the oldest pulse that was not released, if any.
    /// Samples are encoded as [`Encoding::Sc16`](subaperture_core::link::Encoding::Sc16), full scale at 1.
    fn pulse(&mut self) -> Option<(u32, &[u8])>;

    /// Release the pulse returned by [`FrontEnd::pulse`].
    fn release(&mut self);
}
