//! Errors of the radar's clock.
//!
//! A clock that is fast by a part `offset` makes all frequencies larger and all times shorter by it, while
//! the record states the nominal ones: a range `R` reads `R (1 + offset)`, and pulses are taken sooner
//! than it says. Jitter moves the start of a pulse's sampling, not the oscillator: of baseband's
//! frequency `f` the phase turns by `+2 pi f dt`, as if the echo came `dt` sooner. Carriers one after another
//! do not mind it, and a sweep mixed with its own copy only turns as a whole.

use super::stream::{Kind, stream};
use crate::random::normal;
use subaperture_model::radar::Clock;

/// Whether the numbers make sense.
pub(super) fn check(clock: Clock) -> Result<(), String> {
    if clock.offset.abs() < 0.5 && clock.jitter_s.is_finite() && clock.jitter_s >= 0.0 {
        return Ok(());
    }
    Err(format!(
        "the clock's offset of {} is no small part of 1, or its jitter of {} s is none",
        clock.offset, clock.jitter_s
    ))
}

/// How late a pulse is sampled, seconds. All receivers have one clock.
pub(crate) fn jitter_s(clock: &Clock, seed: u64, pulse: usize) -> f64 {
    if clock.jitter_s == 0.0 {
        return 0.0;
    }
    clock.jitter_s * normal(&mut stream(seed, Kind::Jitter, 0, pulse))
}
