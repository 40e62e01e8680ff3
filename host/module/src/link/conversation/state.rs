//! States, events and steps of a conversation.

use std::time::{Duration, Instant};

use subaperture_core::link::Status;

use super::configuring::Setting;
use super::streaming::Stream;
use crate::link::ending::LinkError;

/// Maximum wait in one step, so that Ctrl-C is noticed.
pub(in crate::link) const TICK: Duration = Duration::from_millis(20);

/// Input event of the state machine.
pub(in crate::link) enum Event {
    /// The conversation starts.
    Begun,
    /// Bytes were exchanged with the module and processed.
    Exchanged,
    /// The requested pulse was queued.
    Sent,
    /// The line was reconnected.
    Connected,
    /// An external operation failed.
    Failed(LinkError),
}

/// Action requested by the state machine.
pub(in crate::link) enum Step {
    /// Exchange bytes with the module, waiting at most this long.
    Exchange(Duration),
    /// Send the pulse with this number.
    Pulse(u32),
    /// Restart the conversation for this reason. Reconnect, unless the reason is a restart of the module.
    Restart(LinkError),
    /// Stop; the conversation is over.
    Over(Result<(), LinkError>),
}

/// State of a conversation.
#[derive(Clone, Copy, Debug)]
pub(super) enum State {
    /// Asking the module for its identity.
    Greeting,
    /// Configuring the module.
    Configuring(Setting),
    /// Starting a run.
    Starting,
    /// Sending pulses.
    Streaming(Stream),
    /// Stopping the run. Holds the last status.
    Stopping(Status),
    /// Waiting for the last maps. Holds the last status and its time.
    Draining(Status, Instant),
    /// Asking which sub-CPIs the module has accumulated, from this one on.
    Listing(u32),
    /// Asking for the chip of this patch.
    Collecting(u16),
    /// Reconnecting the line.
    Reconnecting,
    /// Finished.
    Over,
}

/// Elapsed time.
pub(super) fn since(then: Instant, now: Instant) -> Duration {
    now.saturating_duration_since(then)
}
