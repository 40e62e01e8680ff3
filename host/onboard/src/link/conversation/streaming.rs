//! The pulses of a run: which are due, and what the module's answers say about those that were sent.

use std::ops::Range;
use std::time::{Duration, Instant};

use subaperture_core::link::Status;

/// When pulses are due at a given rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    pub(super) rate_hz: f64,
    pub(super) start: Instant,
}

impl Clock {
    /// Pulses that are due by now.
    pub(super) fn due(&self) -> u32 {
        // Saturates beyond the largest number.
        (self.start.elapsed().as_secs_f64() * self.rate_hz) as u32
    }

    /// A wait short enough to miss no pulse's time by much.
    pub(super) fn quarter_period(&self) -> Duration {
        // A rate may be so low that its period is no duration.
        Duration::try_from_secs_f64(0.25 / self.rate_hz).unwrap_or(Duration::MAX)
    }
}

/// How far the pulses of a run have been sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream {
    /// First pulse of the run, and the one after its last.
    first: u32,
    end: u32,
    /// Pulse that is sent next.
    pub(super) next: u32,
    /// Pulses below this may go.
    pub(super) limit: u32,
    /// What the module said last.
    pub(super) told: Status,
    /// When something happened last.
    moved: Instant,
    /// The module was asked since.
    asked: bool,
}

/// What a status says about a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// It took pulses, has room for more, or sent a map.
    On,
    /// So many pulses at the end of those sent did not arrive; they are sent again.
    Back(u32),
    /// Nothing.
    None,
}

impl Stream {
    /// The module has begun a run of these pulses, and said so.
    pub(super) fn new(pulses: Range<u32>, told: Status, now: Instant) -> Self {
        Self {
            first: pulses.start,
            end: pulses.end,
            next: pulses.start,
            limit: pulses.start,
            told,
            moved: now,
            asked: false,
        }
    }

    /// Finds how far pulses may go: as far as the module has room, or at a given rate all that are due.
    pub(super) fn look_ahead(&mut self, clock: Option<&Clock>) {
        self.limit = match clock {
            None => self.told.accept_through.min(self.end),
            Some(clock) => clock.due().min(self.end),
        };
    }

    /// Passes over the pulses that are due and did not go, since a radar does not wait for the line; how
    /// many.
    pub(super) fn pass_over(&mut self) -> u32 {
        let unsent = self.limit.saturating_sub(self.next);
        self.next = self.next.max(self.limit);
        unsent
    }

    /// Whether every pulse has been sent.
    pub(super) fn is_sent(&self) -> bool {
        self.next == self.end
    }

    /// Whether the module has had every pulse.
    pub(super) fn is_taken(&self) -> bool {
        self.told.next_pulse >= self.end
    }

    /// Takes a status of this run. At a given rate (`paced`) nothing is sent twice.
    pub(super) fn hear(&mut self, status: Status, paced: bool, now: Instant) -> Progress {
        let place = |status: &Status| (status.next_pulse, status.accept_through, status.maps);
        let progress = if place(&status) != place(&self.told) {
            Progress::On
        } else if self.asked && status.next_pulse < self.next && !paced {
            // It answers after the last pulse, and waits for an earlier one.
            let behind = self.next - status.next_pulse;
            self.next = status.next_pulse.max(self.first);
            Progress::Back(behind)
        } else {
            Progress::None
        };
        if progress != Progress::None {
            (self.moved, self.asked) = (now, false);
        }
        self.told = status;
        progress
    }

    /// Bytes are on their way, so that no answer is to be expected yet.
    pub(super) fn wait_for_line(&mut self, now: Instant) {
        self.moved = now;
    }

    /// Whether the module should be asked how it stands, after so long without a word; it counts as asked.
    pub(super) fn should_ask(&mut self, patience: Duration, now: Instant) -> bool {
        let ask = now.saturating_duration_since(self.moved) > patience;
        if ask {
            (self.moved, self.asked) = (now, true);
        }
        ask
    }
}
