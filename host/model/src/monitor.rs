//! Progress reports of long work and its cancellation.

/// Observer of long work, called from many threads.
pub trait Monitor: Sync {
    /// Report the finished fraction of the work, 0 to 1.
    fn progress(&self, fraction: f64);

    /// Whether the work should stop as soon as it can.
    fn cancelled(&self) -> bool {
        false
    }

    /// Report that a thread begins a part of `stage`; parts on a thread do not nest.
    fn begins(&self, _stage: &'static str) {}

    /// Report that a thread has finished its part of `stage`.
    fn ends(&self, _stage: &'static str) {}
}

/// Monitor that ignores reports and never cancels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn progress(&self, _fraction: f64) {}
}

/// Guard of a part of a stage; the part ends when the guard is dropped.
pub struct During<'a> {
    monitor: &'a dyn Monitor,
    stage: &'static str,
}

/// Start a part of a stage. Intended for a patch, a block of pixels or some pulses, not for single ones.
pub fn during<'a>(monitor: &'a dyn Monitor, stage: &'static str) -> During<'a> {
    monitor.begins(stage);
    During { monitor, stage }
}

impl Drop for During<'_> {
    fn drop(&mut self) {
        self.monitor.ends(self.stage);
    }
}
