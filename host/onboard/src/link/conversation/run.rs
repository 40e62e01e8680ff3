//! A run: its pulses, from the first to the last map.

use std::ops::Range;
use std::time::Instant;

use subaperture_core::link::{State as ModuleState, Status};

use super::streaming::{Clock, Progress, Stream};
use super::{Conversation, State, Step, TICK, since};
use crate::link::ending::LinkError;
use crate::link::line::Outbox;

/// Bytes that wait for the line beyond which no pulse is added, so that answers stay prompt.
const BACKLOG_BYTES: usize = 8192;

/// A module that answers gets so many times the patience of one that is silent: a large map on a small
/// processor takes seconds.
const STUCK_IDLES: u32 = 6;

impl Conversation<'_> {
    // Runs.

    /// The state that begins the next run, if there is one.
    pub(super) fn next_run(&mut self) -> State {
        let taken = self.ledger.counts.maps_taken;
        match self.runs.next(&mut self.intake, taken, self.clock.as_ref()) {
            Some(_) => State::Starting,
            None => State::Over,
        }
    }

    /// The pulses of this run.
    pub(super) fn pulses(&self) -> Range<u32> {
        let (wanted, sub_cpis) = (self.intake.wanted(), &self.runs.current);
        wanted.first_pulse(sub_cpis.start)..wanted.first_pulse(sub_cpis.end)
    }

    /// Whether the module has begun this run.
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
            // It starts with the first run, and that with the first pulse.
            self.clock.get_or_insert(Clock {
                rate_hz,
                start: Instant::now(),
            });
        }
    }

    /// Takes a status of this run while pulses go.
    pub(super) fn went_on(
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

    /// Sends pulses as far as they may go.
    pub(super) fn stream(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        if let State::Streaming(stream) = &mut self.state {
            stream.look_ahead(self.clock.as_ref());
        }
        self.next_pulse(now, outbox)
    }

    /// A pulse went.
    pub(super) fn sent(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        self.ledger.counts.pulses_sent += 1;
        if let State::Streaming(stream) = &mut self.state {
            stream.next += 1;
        }
        self.next_pulse(now, outbox)
    }

    /// The next pulse, if it may go and the line has room for it.
    fn next_pulse(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        let State::Streaming(stream) = &mut self.state else {
            return self.wait();
        };
        if stream.next < stream.limit && outbox.backlog() < BACKLOG_BYTES {
            return Step::Pulse(stream.next);
        }
        if self.clock.is_some() {
            self.ledger.counts.pulses_unsent += u64::from(stream.pass_over());
        }
        if stream.is_sent() && (stream.is_taken() || self.clock.is_some()) {
            let told = stream.told;
            return self.enter(State::Stopping(told), now, outbox);
        }
        match &self.clock {
            Some(clock) => Step::Exchange(TICK.min(clock.quarter_period())),
            None => self.wait(),
        }
    }

    /// Fails if nothing has come of a run for so long that nothing will.
    pub(super) fn fail_if_stuck(&self, now: Instant) -> Result<(), LinkError> {
        let limit = self.ledger.settings.idle * STUCK_IDLES;
        match since(self.times.advanced, now) > limit {
            true => Err(LinkError::Stuck(limit)),
            false => Ok(()),
        }
    }

    /// The run is over, all its maps are here or lost; where that leads.
    pub(super) fn run_over(&mut self, told: &Status) -> State {
        self.intake.made(told.maps);
        self.in_run = false;
        let counts = &mut self.ledger.counts;
        counts.module_pulses.add(&told.pulses);
        self.intake.end(counts);
        // Of those lost at the end the module cannot know.
        let unknown = self.pulses().end.saturating_sub(told.next_pulse);
        self.ledger.counts.module_pulses.lost += u64::from(unknown);
        self.next_run()
    }

    /// The run broke off, before it began or after the module said this.
    pub(super) fn run_broke_off(&mut self, told: Option<&Status>) {
        let counts = &mut self.ledger.counts;
        if let Some(told) = told {
            // So that the module is told to end it, it still counts as going on.
            counts.module_pulses.add(&told.pulses);
            self.intake.end(counts);
        }
        self.tries.fruitless = match self.runs.break_off(counts.maps_taken) {
            true => 0,
            false => self.tries.fruitless + 1,
        };
        self.tries.recoveries = 0;
    }
}
