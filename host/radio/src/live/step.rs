//! A step as the capture tells it while it runs.

use super::level::Level;
use crate::tone::Mixed;

/// What has been counted since a capture began, in the order of its summary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps taken.
    pub steps: u64,
    /// Of them late, with lost samples, unsteady, clipped, unlocked.
    pub flagged: [u64; 5],
    /// Bursts asked for.
    pub bursts: u64,
    /// Overflows, underflows, late commands, lost packets, gone.
    pub events: [u64; 5],
    /// Samples of a channel that did not come.
    pub lost_samples: u64,
    /// How often the radio waited for the disk.
    pub waits: u64,
    /// Bursts in the queue to the disk.
    pub queue: usize,
    /// As many as it holds.
    pub queue_holds: usize,
    /// Steps that were not shown.
    pub not_shown: u64,
    /// Sweeps that began later than the plan's interval.
    pub late_sweeps: u64,
}

/// A step of a capture, and how the capture stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveStep {
    /// Index of the sweep.
    pub sweep: u64,
    /// Index of the carrier.
    pub step: usize,
    /// Device time of its first sample, seconds.
    pub time_s: f64,
    /// What its burst came to; `None` if nothing of it came.
    pub mixed: Option<Mixed>,
    /// Of reference and echo.
    pub levels: [Level; 2],
    /// Whether it is late, has lost samples, is unsteady, clipped, unlocked.
    pub flagged: [bool; 5],
    /// Since the capture began, this step included.
    pub counts: Counts,
}
