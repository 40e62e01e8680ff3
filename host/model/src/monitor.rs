//! Telling the caller how far long work is, and being told to stop.

/// Watches long work. Called from many threads.
pub trait Monitor: Sync {
    /// A fraction of the work, 0 to 1, is done.
    fn progress(&self, fraction: f64);

    /// Whether the work should stop as soon as it can.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Says nothing, never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn progress(&self, _fraction: f64) {}
}
