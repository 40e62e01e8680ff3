//! Pulse of an antenna pair: frequencies and times of its samples.

use subaperture_model::radar::{Antenna, Motion};
use subaperture_model::track::Trajectory;

/// Frequencies and times of the samples of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Frequency step per sample, hertz.
    pub step_hz: f64,
    /// Number of samples.
    pub count: usize,
    /// Time of sample 0 relative to the pulse's time, seconds.
    pub start_s: f64,
    /// Time step per sample, seconds.
    pub step_s: f64,
    /// Chirp rate whose residual video phase remains in the samples, hertz per second; 0 for none.
    pub residual_hz_s: f64,
}

/// Pulse of an antenna pair.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Motion of the body that carries the antennas.
    pub body: &'a dyn Trajectory,
    /// Transmit antenna: pattern and position on the body.
    pub transmitter: &'a Antenna,
    /// Receive antenna: pattern and position on the body.
    pub receiver: &'a Antenna,
    /// Time of the pulse, seconds.
    pub time_s: f64,
    /// Frequencies and times of the samples.
    pub sweep: Sweep,
    /// Delay that counts as zero, seconds.
    pub reference_s: f64,
    /// Motion model within a pulse.
    pub motion: Motion,
    /// Range at which the spreading factor is 1, that of the reference point at the middle pulse, metres; `None` for no
    /// spreading loss.
    pub spreading_from_m: Option<f64>,
}
