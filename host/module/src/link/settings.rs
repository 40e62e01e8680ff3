//! Timeouts and retries of a session.

use std::time::Duration;

use subaperture_core::link::Level;

/// Timeouts and retries of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Time to wait for an answer before a request is repeated.
    pub answer: Duration,
    /// Silence after which the line is reconnected, and abandoned if that does not help. Added to it is the time that sent data
    /// may still take to pass, by the line's bit rate, or at 4 kB per second if unknown.
    pub idle: Duration,
    /// Maximum number of additional runs for missing maps.
    pub retries: u32,
    /// Pulses per second regardless of the module's room. `None`: as fast as it has room.
    pub rate_hz: Option<f64>,
    /// Number of the first configuration and run. Should differ from that of earlier sessions, which a module may remember.
    pub first_number: u32,
    /// Least severe level of the module's events to request. `None` for no events.
    pub events: Option<Level>,
}

/// Factor on the idle time for a module that answers without progress: a large map or a sweep takes seconds on a small processor, and longer on an
/// emulated one.
const STUCK_IDLES: u32 = 6;

impl Settings {
    /// Time without progress after which a module that answers is given up.
    pub(super) fn stuck(&self) -> Duration {
        self.idle * STUCK_IDLES
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            answer: Duration::from_millis(500),
            idle: Duration::from_secs(10),
            retries: 3,
            rate_hz: None,
            first_number: 1,
            events: None,
        }
    }
}
