//! Control of a module from greeting to last product: a state machine without input or output.
//!
//! ```text
//!            open                       transfer
//!             │                             │
//!             v  its identity               v  (settings: `configuring`)
//!   ┌────> Greeting ──────────────────> Configuring ──ready──┐
//!   │         │ first time                                   v
//!   │         v                    Over <──nothing missing── ○ <──────────────────────────────┐
//!   │       Over                                             │ next run of sub-CPIs           │
//!   │                                                        v                                │
//!   │                                  Starting ──begun──> Streaming ──all sent──> Stopping   │
//!   │                                                        │ ^ a lost tail          │       │
//!   │                                                        └─┘                no more pulses│
//!   │                                                                                 v       │
//!   └── Reconnecting <── a recoverable error, in any state                        Draining ───┘
//!                        (any other error: over)                                        done
//! ```
//!
//! **Steps.** [`Conversation::step`] takes an [`Event`] and returns the next action as a [`Step`]; commands are queued in the
//! [`Outbox`]. [`Conversation::hear`] processes reports as they arrive. [`Conversation::next`] contains all transitions caused
//! by answers, [`Conversation::broken`] all those caused by errors.
//!
//! **Requests.** While greeting, configuring, starting and stopping, a command is repeated until the module's answer confirms
//! it.
//!
//! **Runs.** The first run covers all sub-CPIs. A tail of pulses that did not arrive (the module answers after the last one but
//! expects an earlier one) is sent again immediately; any other lost pulse costs its sub-CPI. Further runs repeat the sub-CPIs
//! with a missing map, up to [`Settings::retries`] times. At a fixed pulse rate, or with samples from the front end of
//! the module, no sub-CPI is repeated, since a radar does not wait.
//!
//! **Images.** A module that accumulates an image is asked after each run which sub-CPIs the image contains
//! (`State::Listing`), and for the chips of all patches when no run is left (`State::Collecting`). After a failure of the line
//! the image is still there: the module is not configured again, and the list shows the missing sub-CPIs. After a restart of the
//! module everything is sent again. For previews a pass is divided into runs, and the chips are collected after each of them.
//!
//! **Error recovery.** After a line failure, silence, a restart of the module, or lack of progress: reconnect, greet, abort the
//! current run, configure, and continue with what is missing of the run. Recovery is abandoned after eight failures without a
//! map in between.

mod configuring;
mod hearing;
mod news;
mod question;
mod questions;
mod run;
mod runs;
mod state;
mod streaming;
#[cfg(test)]
mod tests;

use std::mem;
use std::time::Instant;

use subaperture_core::link::{Command, Refusal, State as ModuleState};

use super::ending::LinkError;
use super::identity::Identity;
use super::intake::Intake;
use super::line::Outbox;
use super::products::{AccumulatedImage, Request};
pub(super) use configuring::JobSettings;
use configuring::{Setting, is_misattributed};
pub(super) use news::Ledger;
use news::News;
use question::{ATTEMPTS, Question};
use runs::Runs;
use streaming::{Clock, Stream};

pub(super) use state::{Event, Step, TICK};
use state::{State, since};

/// Maximum number of failures without a map in between.
const FRUITLESS: u32 = 8;

/// Times of the last events.
struct Times {
    /// A frame was received.
    heard: Instant,
    /// The module was greeted.
    greeted: Instant,
    /// The run progressed: a pulse was accepted, or a part of a map received.
    advanced: Instant,
}

/// Numbers of attempts.
#[derive(Default)]
struct Tries {
    /// Configurations sent since the last greeting.
    configurations: u32,
    /// Restarts of the conversation since a run was interrupted.
    recoveries: u32,
    /// Consecutive runs that were interrupted without a map.
    without_progress: u32,
}

/// Conversation with a module about a job.
pub(super) struct Conversation<'c> {
    pub(super) ledger: &'c mut Ledger,
    intake: Intake<'c>,
    job: JobSettings<'c>,
    /// Identity of the module, once known.
    identity: Option<Identity>,
    state: State,
    question: Question,
    news: News,
    times: Times,
    tries: Tries,
    runs: Runs,
    /// Pulse clock, from the first run on.
    clock: Option<Clock>,
    /// A run was started and its end not seen; a module that greets must report its state.
    in_run: bool,
    /// The module was configured for this job.
    configured: bool,
    /// The chips being collected are a preview.
    previewing: bool,
    /// Preview that was received.
    preview: Option<AccumulatedImage>,
}

impl<'c> Conversation<'c> {
    /// Create a conversation. Without an identity it consists of a greeting only; otherwise it processes `job`.
    pub(super) fn new(
        ledger: &'c mut Ledger,
        job: JobSettings<'c>,
        intake: Intake<'c>,
        identity: Option<Identity>,
    ) -> Self {
        let now = Instant::now();
        let (settings, from_front_end) = (ledger.settings, job.from_front_end);
        let sub_cpis = intake.wanted().num_sub_cpis();
        let most = match job.request {
            Request::Image(image) => sub_cpis.div_ceil(image.previews.saturating_add(1)),
            _ => u32::MAX,
        };
        Self {
            ledger,
            intake,
            job,
            identity,
            state: State::Over,
            question: Question::new(now),
            news: News::default(),
            times: Times {
                heard: now,
                greeted: now,
                advanced: now,
            },
            tries: Tries::default(),
            runs: Runs::new(
                settings.retries,
                settings.rate_hz.is_some() || from_front_end,
                most,
            ),
            clock: None,
            in_run: false,
            configured: false,
            previewing: false,
            preview: None,
        }
    }

    /// Identity of the module, if known.
    pub(super) fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// Whether a run was started and its end not seen.
    pub(super) fn is_in_run(&self) -> bool {
        self.in_run
    }

    /// Sub-CPI and patch of every missing map.
    pub(super) fn missing_maps(&self) -> Vec<(u32, u16)> {
        self.intake.missing_maps()
    }

    /// Take the preview that was received, if any.
    pub(super) fn take_preview(&mut self) -> Option<AccumulatedImage> {
        self.preview.take()
    }

    /// Process `event` and return the next action.
    pub(super) fn step(&mut self, event: Event, now: Instant, outbox: &mut Outbox) -> Step {
        let step = match event {
            Event::Begun => {
                let first = match self.identity {
                    None => State::Greeting,
                    Some(_) => State::Configuring(Setting::Abort),
                };
                Ok(self.enter(first, now, outbox))
            }
            Event::Connected => Ok(self.enter(State::Greeting, now, outbox)),
            Event::Sent => Ok(self.sent(now, outbox)),
            Event::Exchanged => self.exchanged(now, outbox),
            Event::Failed(error) => Err(error),
        };
        step.unwrap_or_else(|error| self.broken(error, now, outbox))
    }

    /// Process the result of an exchange.
    fn exchanged(&mut self, now: Instant, outbox: &mut Outbox) -> Result<Step, LinkError> {
        let news = mem::take(&mut self.news);
        self.check_liveness(&news, now, outbox)?;
        match self.next(&news, now, outbox)? {
            Some(state) => Ok(self.enter(state, now, outbox)),
            None => self.stay(now, outbox),
        }
    }

    /// Next state after received reports, if any.
    fn next(
        &mut self,
        news: &News,
        now: Instant,
        outbox: &mut Outbox,
    ) -> Result<Option<State>, LinkError> {
        self.fail_if_refused(news)?;
        let next = match (self.state, &news.status) {
            (State::Greeting, _) => self.greeted(news)?,
            (State::Configuring(Setting::Abort), Some(status)) if self.holds_image(status) => {
                Some(State::Listing(0))
            }
            (State::Configuring(setting), Some(status))
                if setting.is_answered_by(status, self.ledger.configuration)? =>
            {
                Some(match setting.next(&self.job) {
                    Some(Setting::Configure) => self.configure_anew(),
                    Some(setting) => State::Configuring(setting),
                    None => {
                        self.configured = true;
                        self.next_run()
                    }
                })
            }
            (State::Starting, Some(status)) if self.has_begun(status)? => {
                Some(State::Streaming(Stream::new(self.pulses(), *status, now)))
            }
            (State::Streaming(stream), Some(status)) => {
                self.check_mine(status)?;
                self.track_progress(stream, *status, now, outbox);
                None
            }
            (State::Stopping(_), Some(status)) => {
                self.check_mine(status)?;
                match status.state {
                    ModuleState::Finishing => Some(State::Draining(*status, now)),
                    ModuleState::Done => Some(self.run_over(status)),
                    _ => None,
                }
            }
            (State::Draining(before, _), Some(status)) => {
                self.check_mine(status)?;
                if status.maps != before.maps {
                    self.times.advanced = now;
                }
                self.state = State::Draining(*status, now);
                (status.state == ModuleState::Done).then(|| self.run_over(status))
            }
            (State::Listing(_), _) => news.listed.map(|next| match next {
                Some(first) => State::Listing(first),
                None => self.preview_or_next_run(),
            }),
            (State::Collecting(patch), _) => {
                if news.map {
                    self.question.asked = now;
                }
                match self.intake.next_chip() {
                    Some(next) if next == patch => None,
                    Some(next) => Some(State::Collecting(next)),
                    None if mem::take(&mut self.previewing) => {
                        self.preview = self.intake.take_preview();
                        Some(self.next_run())
                    }
                    None => Some(State::Over),
                }
            }
            _ => None,
        };
        Ok(next)
    }

    /// React to an error: reconfigure, reconnect, or end.
    fn broken(&mut self, error: LinkError, now: Instant, outbox: &mut Outbox) -> Step {
        if self.identity.is_none() {
            // Without an identity there is nothing to recover.
            return Step::Over(Err(error));
        }
        let mut error = error;
        match self.state {
            State::Configuring(setting) => {
                error = setting.meaning(error);
                self.configured &= setting == Setting::Abort;
                if is_misattributed(&error) && self.tries.configurations < ATTEMPTS {
                    return self.enter(State::Configuring(Setting::Abort), now, outbox);
                }
            }
            State::Starting => {
                error = match error {
                    LinkError::Refused(Refusal::NotConfigured | Refusal::Running) => {
                        LinkError::Restarted
                    }
                    error => error,
                };
                self.run_interrupted(None, &error);
            }
            State::Streaming(Stream { last_status, .. })
            | State::Stopping(last_status)
            | State::Draining(last_status, _) => {
                self.run_interrupted(Some(&last_status), &error);
                if self.job.from_front_end && matches!(error, LinkError::Stuck(_)) {
                    // The front end provides no more pulses.
                    self.runs.abandon();
                }
            }
            State::Listing(_) | State::Collecting(_) => {
                self.tries.without_progress += 1;
                self.tries.recoveries = 0;
                if let LinkError::Refused(Refusal::PatchIndex | Refusal::NotConfigured) = error {
                    error = LinkError::Restarted;
                }
            }
            State::Greeting | State::Reconnecting | State::Over => {}
        }
        let given_up =
            self.tries.without_progress > FRUITLESS || self.tries.recoveries == FRUITLESS;
        if given_up || !error.is_passing() {
            return Step::Over(Err(error));
        }
        self.tries.recoveries += 1;
        match error {
            LinkError::Restarted => self.ledger.counts.restarts += 1,
            _ => self.ledger.counts.reconnects += 1,
        }
        self.state = State::Reconnecting;
        Step::Restart(error)
    }

    /// Enter a state and do its initial action.
    fn enter(&mut self, state: State, now: Instant, outbox: &mut Outbox) -> Step {
        self.state = state;
        match state {
            State::Greeting => {
                self.times.heard = now;
                self.tries.configurations = 0;
                self.ask_first(now, outbox)
            }
            State::Configuring(setting) => {
                match setting {
                    Setting::Abort => {
                        self.tries.configurations += 1;
                        if let least @ Some(_) = self.ledger.settings.events {
                            outbox.send(&Command::Log { least });
                        }
                    }
                    Setting::Configure => {
                        self.ledger.configuration = self.ledger.configuration.wrapping_add(1);
                    }
                    _ => {}
                }
                self.ask_first(now, outbox)
            }
            State::Starting => {
                self.ledger.run = self.ledger.run.wrapping_add(1);
                self.ask_first(now, outbox)
            }
            State::Streaming(_) => {
                self.run_begins(now);
                self.stream(now, outbox)
            }
            State::Stopping(_) | State::Listing(_) | State::Collecting(_) => {
                self.ask_first(now, outbox)
            }
            State::Draining(..) => {
                self.times.advanced = now;
                self.wait()
            }
            State::Reconnecting => self.wait(),
            State::Over => Step::Over(Ok(())),
        }
    }

    /// Remain in the state and repeat the request if due.
    fn stay(&mut self, now: Instant, outbox: &mut Outbox) -> Result<Step, LinkError> {
        let answer = self.ledger.settings.answer;
        match self.state {
            State::Streaming(mut stream) => {
                if self.clock.is_none() {
                    // At a fixed rate the stream ends by itself.
                    self.fail_if_stuck(now)?;
                }
                if outbox.backlog() > 0 {
                    stream.wait_for_line(now);
                }
                if stream.should_ask(answer, now) {
                    outbox.send(&Command::Status);
                }
                self.state = State::Streaming(stream);
                Ok(self.stream(now, outbox))
            }
            State::Draining(last_status, mut moved) => {
                self.fail_if_stuck(now)?;
                if outbox.backlog() > 0 {
                    moved = now;
                }
                if since(moved, now) > answer {
                    outbox.send(&Command::Status);
                    moved = now;
                }
                self.state = State::Draining(last_status, moved);
                Ok(self.wait())
            }
            _ => self.ask_again(now, outbox),
        }
    }

    /// Wait for the line.
    fn wait(&self) -> Step {
        Step::Exchange(TICK.min(self.ledger.settings.answer))
    }
}
