//! How patient a session is with its module.

use std::time::Duration;

/// How patient a session is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Wait for an answer before asking again.
    pub answer: Duration,
    /// Silence after which the line is connected anew, and given up if that does not help. To this comes the
    /// time that what was sent may still take to pass, by the line's speed, or 4 kB a second where it
    /// tells none.
    pub idle: Duration,
    /// Further runs, at most, over all that is missing.
    pub retries: u32,
    /// Pulses a second, whether or not the module has room; as fast as it has room if none.
    pub rate_hz: Option<f64>,
    /// Number of the first configuration and run. A module may remember those of an earlier
    /// session; they should differ.
    pub first_number: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            answer: Duration::from_millis(500),
            idle: Duration::from_secs(10),
            retries: 3,
            rate_hz: None,
            first_number: 1,
        }
    }
}
