//! Errors of the sample clock.
//!
//! A clock with the fractional frequency error `offset` raises all frequencies and shortens all times by this fraction,
//! while the recording states the nominal values: a range `R` appears as `R (1 + offset)`, and pulses are sampled
//! earlier than recorded. Jitter shifts the start of a pulse's sampling but not the oscillator: the phase at baseband
//! frequency `f` changes by `+2 pi f dt`, as if the echo arrived `dt` earlier. Stepped carriers are not affected, and
//! an FMCW sweep mixed with its own copy only gets a constant phase.

use super::stream::{Kind, stream};
use crate::random::normal;
use subaperture_model::radar::Clock;

/// Check the clock parameters.
pub(super) fn check(clock: Clock) -> Result<(), String> {
    if clock.offset.abs() < 0.5 && clock.jitter_s.is_finite() && clock.jitter_s >= 0.0 {
        return Ok(());
    }
    Err(format!(
        "clock offset of {}, jitter of {} s: expected an offset below 0.5 in magnitude, and a finite jitter that is not negative",
        clock.offset, clock.jitter_s
    ))
}

/// Sampling delay of a pulse due to jitter, seconds. All receivers share a clock.
pub(crate) fn jitter_s(clock: &Clock, seed: u64, pulse: usize) -> f64 {
    if clock.jitter_s == 0.0 {
        return 0.0;
    }
    clock.jitter_s * normal(&mut stream(seed, Kind::Jitter, 0, pulse))
}
