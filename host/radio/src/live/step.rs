//! Message from the capture to the live view, one per step.

use super::level::Level;
use crate::tone::Mixed;

/// Counters since the start of a capture, in the order of its summary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of steps captured.
    pub steps: u64,
    /// Steps flagged late, with lost samples, unsteady, clipped, unlocked.
    pub flagged: [u64; 5],
    /// Bursts requested from the radio.
    pub bursts: u64,
    /// Overruns, underruns, late commands, lost packets, disconnections.
    pub events: [u64; 5],
    /// Lost samples per channel.
    pub lost_samples: u64,
    /// Number of times that the radio waited for the disk.
    pub waits: u64,
    /// Bursts in the queue to the disk.
    pub queue: usize,
    /// Capacity of that queue, bursts.
    pub queue_holds: usize,
    /// Steps dropped from the live view.
    pub not_shown: u64,
    /// Sweeps that began later than the plan's interval.
    pub late_sweeps: u64,
}

/// Step of a capture, with the counters of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveStep {
    /// Index of the sweep.
    pub sweep: u64,
    /// Index of the carrier.
    pub step: usize,
    /// Device time of the first sample, seconds.
    pub time_s: f64,
    /// Mixed result of the burst; `None` if all its samples are lost.
    pub mixed: Option<Mixed>,
    /// Levels of reference and echo.
    pub levels: [Level; 2],
    /// Flags: late, lost samples, unsteady, clipped, unlocked.
    pub flagged: [bool; 5],
    /// Counters since the start of the capture, this step included.
    pub counts: Counts,
}
