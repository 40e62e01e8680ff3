//! Run control: pulses of a run, from the first pulse to the last map.

use std::ops::Range;
use std::time::Instant;

use subaperture_core::link::{State as ModuleState, Status};

use super::configuring::Setting;
use super::streaming::{Clock, Progress, Stream};
use super::{Conversation, State, Step, TICK, since};
use crate::link::ending::LinkError;
use crate::link::line::Outbox;
use crate::link::products::Request;

/// Backlog in bytes above which no pulse is added, so that answers stay prompt.
const BACKLOG_BYTES: usize = 8192;

impl Conversation<'_> {
    // Runs.

    /// State that starts the next run, or requests the accumulated image, or the end.
    pub(super) fn next_run(&mut self) -> State {
        let taken = self.ledger.counts.maps_taken;
        match self.runs.next(&mut self.intake, taken, self.clock.as_ref()) {
            Some(_) => State::Starting,
            None => self
                .intake
                .next_chip()
                .map_or(State::Over, State::Collecting),
        }
    }

    /// State that requests a preview between two runs of a pass, or that of the next run.
    pub(super) fn preview_or_next_run(&mut self) -> State {
        let wanted = matches!(self.job.request, Request::Image(image) if image.previews > 0);
        match self.intake.next_chip() {
            Some(patch) if wanted && self.runs.has_next() => {
                self.previewing = true;
                State::Collecting(patch)
            }
            _ => self.next_run(),
        }
    }

    /// Prepare to fetch the image that a cancelled conversation has accumulated: the next steps end the run, and request the
    /// list of sub-CPIs and the chips. Returns false if the module holds no image.
    pub(in crate::link) fn abandon_runs(&mut self) -> bool {
        self.runs.abandon();
        self.configured && self.intake.is_image()
    }

    /// Whether the module, no longer busy, still holds the image of the current configuration.
    pub(super) fn holds_image(&self, status: &Status) -> bool {
        self.configured
            && self.intake.is_image()
            && status.configuration == self.ledger.configuration
            && matches!(status.state, ModuleState::Ready | ModuleState::Done)
    }

    /// Configure the module, which discards its image.
    pub(super) fn configure_anew(&mut self) -> State {
        self.configured = false;
        self.previewing = false;
        if self.intake.is_image() {
            self.intake.reset_image(&mut self.ledger.counts);
            self.runs.start_over();
        }
        State::Configuring(Setting::Configure)
    }

    /// Pulses of the current run.
    pub(super) fn pulses(&self) -> Range<u32> {
        let (wanted, sub_cpis) = (self.intake.wanted(), &self.runs.current);
        wanted.first_pulse(sub_cpis.start)..wanted.first_pulse(sub_cpis.end)
    }

    /// Whether the module has started the current run.
    pub(super) fn has_begun(&self, status: &Status) -> Result<bool, LinkError> {
        match status.configuration == self.ledger.configuration {
            true => Ok(status.run == self.ledger.run && status.state != ModuleState::Idle),
            false => Err(LinkError::Restarted),
        }
    }

    pub(super) fn run_begins(&mut self, now: Instant) {
        self.ledger.counts.runs += 1;
        self.intake.begin();
        self.in_run = true;
        self.times.advanced = now;
        if let Some(rate_hz) = self.ledger.settings.rate_hz {
            // The clock starts with the first run and its first pulse.
            self.clock.get_or_insert(Clock {
                rate_hz,
                start: Instant::now(),
            });
        }
    }

    /// Process a status of this run while pulses are sent.
    pub(super) fn track_progress(
        &mut self,
        stream: Stream,
        status: Status,
        now: Instant,
        outbox: &mut Outbox,
    ) {
        let mut stream = stream;
        match stream.hear(status, self.clock.is_some(), now) {
            Progress::On => self.times.advanced = now,
            Progress::Back(pulses) => {
                self.ledger.counts.pulses_resent += u64::from(pulses);
            }
            Progress::None => {}
        }
        if status.next_pulse >= stream.next {
            outbox.is_clear();
        }
        self.state = State::Streaming(stream);
    }

    /// Send pulses as far as allowed.
    pub(super) fn stream(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        if let State::Streaming(stream) = &mut self.state {
            stream.look_ahead(self.clock.as_ref());
        }
        self.next_pulse(now, outbox)
    }

    /// Note that a pulse was sent.
    pub(super) fn sent(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        self.ledger.counts.pulses_sent += 1;
        if let State::Streaming(stream) = &mut self.state {
            stream.next += 1;
        }
        self.next_pulse(now, outbox)
    }

    /// Next pulse, if allowed and if the line has room.
    fn next_pulse(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        let State::Streaming(stream) = &mut self.state else {
            return self.wait();
        };
        if stream.next < stream.limit && outbox.backlog() < BACKLOG_BYTES {
            return Step::Pulse(stream.next);
        }
        if self.clock.is_some() {
            self.ledger.counts.pulses_unsent += u64::from(stream.skip_overdue());
        }
        if stream.is_sent() && (stream.is_taken() || self.clock.is_some()) {
            let last_status = stream.last_status;
            return self.enter(State::Stopping(last_status), now, outbox);
        }
        match &self.clock {
            Some(clock) => Step::Exchange(TICK.min(clock.quarter_period())),
            None => self.wait(),
        }
    }

    /// Fail if the run made no progress for too long.
    pub(super) fn fail_if_stuck(&self, now: Instant) -> Result<(), LinkError> {
        let limit = self.ledger.settings.stuck();
        match since(self.times.advanced, now) > limit {
            true => Err(LinkError::Stuck(limit)),
            false => Ok(()),
        }
    }

    /// The run is over and all its maps were received or lost. Returns the next state.
    pub(super) fn run_over(&mut self, last_status: &Status) -> State {
        self.intake.made(last_status.maps);
        self.in_run = false;
        let counts = &mut self.ledger.counts;
        counts.module_pulses.add(&last_status.pulses);
        self.intake.end(counts);
        // The module cannot know of pulses lost at the end.
        let unknown = self.pulses().end.saturating_sub(last_status.next_pulse);
        self.ledger.counts.module_pulses.lost += u64::from(unknown);
        match self.intake.is_image() {
            true => State::Listing(0),
            false => self.next_run(),
        }
    }

    /// The run was interrupted by an error, before it started or after this status.
    pub(super) fn run_interrupted(&mut self, last_status: Option<&Status>, error: &LinkError) {
        // An image survives anything but a restart of the module.
        let accumulated = self.intake.is_image()
            && !matches!(error, LinkError::Restarted)
            && last_status.is_some_and(|status| status.maps > 0);
        let counts = &mut self.ledger.counts;
        if let Some(last_status) = last_status {
            // It still counts as active, so that the module is made to end it.
            counts.module_pulses.add(&last_status.pulses);
            self.intake.end(counts);
        }
        let taken = self.runs.interrupt(counts.maps_taken);
        self.tries.without_progress = match taken || accumulated {
            true => 0,
            false => self.tries.without_progress + 1,
        };
        self.tries.recoveries = 0;
    }
}
