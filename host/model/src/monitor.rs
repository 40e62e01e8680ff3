//! Telling the caller how far long work is and what it is at, and being told to stop.

/// Watches long work. Called from many threads.
pub trait Monitor: Sync {
    /// A fraction of the work, 0 to 1, is done.
    fn progress(&self, fraction: f64);

    /// Whether the work should stop as soon as it can.
    fn cancelled(&self) -> bool {
        false
    }

    /// A thread begins with some of a stage of the work, in the middle of no other.
    fn begins(&self, _stage: &'static str) {}

    /// It has done what it began.
    fn ends(&self, _stage: &'static str) {}
}

/// Says nothing, never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn progress(&self, _fraction: f64) {}
}

/// Some of a stage of the work, for as long as this is held.
pub struct During<'a> {
    monitor: &'a dyn Monitor,
    stage: &'static str,
}

/// Begins with some of a stage; for a patch, a run of pixels or some pulses, not for one.
pub fn during<'a>(monitor: &'a dyn Monitor, stage: &'static str) -> During<'a> {
    monitor.begins(stage);
    During { monitor, stage }
}

impl Drop for During<'_> {
    fn drop(&mut self) {
        self.monitor.ends(self.stage);
    }
}
