//! Pulse to which impairments are applied.

use subaperture_model::radar::Waveform;

/// Pulse to which impairments are applied.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Waveform actually transmitted and sampled.
    pub waveform: &'a Waveform,
    /// Index of the pulse among those of all transmitters.
    pub pulse: usize,
    /// Index of the receiver.
    pub receiver: usize,
    /// True time of the pulse, seconds.
    pub time_s: f64,
    /// Delay of the reference, seconds.
    pub delay_s: f64,
}
