//! Pulse stream of a run: pulses due, and the module's acknowledgements.

use std::ops::Range;
use std::time::{Duration, Instant};

use subaperture_core::link::Status;

/// Times of pulses at a fixed rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    pub(super) rate_hz: f64,
    pub(super) start: Instant,
}

impl Clock {
    /// Number of pulses due now.
    pub(super) fn due(&self) -> u32 {
        // Saturates at the largest number.
        (self.start.elapsed().as_secs_f64() * self.rate_hz) as u32
    }

    /// Wait time short enough to send pulses close to their due times.
    pub(super) fn quarter_period(&self) -> Duration {
        // The period at a very low rate may exceed the range of a duration.
        Duration::try_from_secs_f64(0.25 / self.rate_hz).unwrap_or(Duration::MAX)
    }
}

/// Largest number of times that the time between two requests for the status is doubled.
const MAX_DOUBLINGS: u32 = 3;

/// Progress of the pulses of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream {
    /// First pulse of the run, and one past its last.
    first: u32,
    end: u32,
    /// Next pulse to send.
    pub(super) next: u32,
    /// Pulses below this number may be sent.
    pub(super) limit: u32,
    /// Last status of the module.
    pub(super) last_status: Status,
    /// Time of the last progress.
    moved: Instant,
    /// Number of times that the module was asked for its status since.
    asked: u32,
}

/// Progress reported by a status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// Pulses accepted, more room, or a map sent.
    On,
    /// Number of pulses at the end of those sent that did not arrive; they are sent again.
    Back(u32),
    /// No progress.
    None,
}

impl Stream {
    /// Create the stream for a run of these pulses that the module has started with this status.
    pub(super) fn new(pulses: Range<u32>, last_status: Status, now: Instant) -> Self {
        Self {
            first: pulses.start,
            end: pulses.end,
            next: pulses.start,
            limit: pulses.start,
            last_status,
            moved: now,
            asked: 0,
        }
    }

    /// Compute how far pulses may be sent: as far as the module has room, or at a fixed rate all that are due.
    pub(super) fn look_ahead(&mut self, clock: Option<&Clock>) {
        self.limit = match clock {
            None => self.last_status.accept_through.min(self.end),
            Some(clock) => clock.due().min(self.end),
        };
    }

    /// Skip pulses that are due but could not be sent, since a radar does not wait for the line. Returns their number.
    pub(super) fn skip_overdue(&mut self) -> u32 {
        let unsent = self.limit.saturating_sub(self.next);
        self.next = self.next.max(self.limit);
        unsent
    }

    /// Whether every pulse was sent.
    pub(super) fn is_sent(&self) -> bool {
        self.next == self.end
    }

    /// Whether the module has received every pulse.
    pub(super) fn is_taken(&self) -> bool {
        self.last_status.next_pulse >= self.end
    }

    /// Process a status of this run. At a fixed rate (`paced`) nothing is sent twice.
    pub(super) fn hear(&mut self, status: Status, paced: bool, now: Instant) -> Progress {
        let place = |status: &Status| (status.next_pulse, status.accept_through, status.maps);
        let progress = if place(&status) != place(&self.last_status) {
            Progress::On
        } else if self.asked > 0 && status.next_pulse < self.next && !paced {
            // It answered after the last pulse but expects an earlier one.
            let behind = self.next - status.next_pulse;
            self.next = status.next_pulse.max(self.first);
            Progress::Back(behind)
        } else {
            Progress::None
        };
        if progress != Progress::None {
            (self.moved, self.asked) = (now, 0);
        }
        self.last_status = status;
        progress
    }

    /// Data is still being sent, so no answer is expected yet.
    pub(super) fn wait_for_line(&mut self, now: Instant) {
        self.moved = now;
    }

    /// Whether to ask the module for its status after this much silence, each time twice as much: a busy module would spend more bytes
    /// on answers than on products. Counts as asked.
    pub(super) fn should_ask(&mut self, patience: Duration, now: Instant) -> bool {
        let patience = patience * (1 << self.asked.min(MAX_DOUBLINGS));
        let ask = now.saturating_duration_since(self.moved) > patience;
        if ask {
            (self.moved, self.asked) = (now, self.asked + 1);
        }
        ask
    }
}
