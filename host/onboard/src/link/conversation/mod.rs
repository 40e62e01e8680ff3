//! Leading a module, from the greeting to the last map: one state machine, without input or output.
//!
//! ```text
//!            open                       transfer
//!             │                             │
//!             v  its identity               v  (what it is told: `configuring`)
//!   ┌────> Greeting ──────────────────> Configuring ──ready──┐
//!   │         │ first time                                   v
//!   │         v                    Over <──nothing missing── ○ <──────────────────────────────┐
//!   │       Over                                             │ next run of sub-CPIs           │
//!   │                                                        v                                │
//!   │                                  Starting ──begun──> Streaming ──all sent──> Stopping   │
//!   │                                                        │ ^ a lost tail          │       │
//!   │                                                        └─┘                no more pulses│
//!   │                                                                                 v       │
//!   └── Reconnecting <── a passing error, of any state                            Draining ───┘
//!                        (another one: over)                                            done
//! ```
//!
//! **Steps.** [`Conversation::step`] is told what happened ([`Event`]) and says what is to be done about it
//! ([`Step`]); commands wait in the [`Outbox`]. Reports are taken by [`Conversation::hear`] as they come.
//! [`Conversation::next`] has all transitions that answers bring about, [`Conversation::broken`] all those of
//! errors.
//!
//! **Questions.** While greeting, configuring, starting and stopping, a command is repeated until the
//! module's answer says that it was heard.
//!
//! **Runs.** The first goes through all sub-CPIs. A tail of pulses that did not arrive (the module
//! answers after the last of them and expects an earlier one) is sent again at once; a pulse lost amid others
//! costs its sub-CPI. When the run is over, further runs go through the sub-CPIs of which a map is
//! missing, up to [`Settings::retries`] times. At a given rate nothing is sent twice:
//! that is a radar, which does not wait.
//!
//! **When things break.** A line that fails, a silent module, one that began anew or one that answers and
//! does not go on: connect, greet,
//! end what is going on, configure, and go on with what is missing of the run. That is given up when
//! it happened eight times without a map in between.

mod configuring;
mod news;
mod questions;
mod run;
mod runs;
mod streaming;
#[cfg(test)]
mod tests;

use std::mem;
use std::time::{Duration, Instant};

use subaperture_core::link::{Command, Refusal, State as ModuleState, Status};

use super::ending::LinkError;
use super::identity::Identity;
use super::intake::Intake;
use super::line::Outbox;
pub(super) use configuring::Told;
use configuring::{Setting, is_mixed_up};
pub(super) use news::Ledger;
use news::News;
use questions::{ATTEMPTS, Question};
use runs::Runs;
use streaming::{Clock, Stream};

/// Longest wait in one go, so that Ctrl-C is heard.
pub(super) const TICK: Duration = Duration::from_millis(20);

/// Times that things may break without a map in between.
const FRUITLESS: u32 = 8;

/// What happened.
pub(super) enum Event {
    /// The conversation begins.
    Begun,
    /// Bytes were exchanged with the module, and what came was heard.
    Exchanged,
    /// The pulse that was to be sent waits for the line.
    Sent,
    /// The line is connected anew.
    Connected,
    /// Something outside failed.
    Failed(LinkError),
}

/// What is to be done.
pub(super) enum Step {
    /// Exchange bytes with the module, waiting so long.
    Exchange(Duration),
    /// Send the pulse of this number.
    Pulse(u32),
    /// Begin anew for this reason; connect anew, unless it is that the module did.
    Anew(LinkError),
    /// Nothing: it is over.
    Over(Result<(), LinkError>),
}

/// Where a conversation stands.
#[derive(Clone, Copy, Debug)]
enum State {
    /// The module is asked who it is.
    Greeting,
    /// It is told what it is to do.
    Configuring(Setting),
    /// It is told that a run begins.
    Starting,
    /// Pulses go.
    Streaming(Stream),
    /// It is told that there are no more; this is what it said last.
    Stopping(Status),
    /// Maps are still to come; this is what it said last, and when.
    Draining(Status, Instant),
    /// The line is being connected anew.
    Reconnecting,
    /// All was done.
    Over,
}

/// When things happened last.
struct Times {
    /// A frame came.
    heard: Instant,
    /// The module was greeted.
    greeted: Instant,
    /// A run went on: a pulse was taken, or a part of a map came.
    advanced: Instant,
}

/// How often things were tried.
#[derive(Default)]
struct Tries {
    /// Configurations sent since the last greeting.
    configurations: u32,
    /// Times that the conversation was begun anew since a run broke off.
    recoveries: u32,
    /// Runs in a row that broke off without a map.
    fruitless: u32,
}

/// A conversation with a module about a job.
pub(super) struct Conversation<'c> {
    pub(super) ledger: &'c mut Ledger,
    intake: Intake<'c>,
    job: Told<'c>,
    /// Who the module is, once it has said so.
    identity: Option<Identity>,
    state: State,
    question: Question,
    news: News,
    times: Times,
    tries: Tries,
    runs: Runs,
    /// The pulses' rate, from the first run on.
    clock: Option<Clock>,
    /// A run was begun and not seen to end, and a module that greets has to say how it stands.
    in_run: bool,
}

impl<'c> Conversation<'c> {
    /// Begins with a greeting, and ends with it, if nobody knows who the module is; else goes on with `job`.
    pub(super) fn new(
        ledger: &'c mut Ledger,
        job: Told<'c>,
        intake: Intake<'c>,
        identity: Option<Identity>,
    ) -> Self {
        let now = Instant::now();
        let settings = ledger.settings;
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
            runs: Runs::new(settings.retries, settings.rate_hz.is_some()),
            clock: None,
            in_run: false,
        }
    }

    /// Who the module is, if it has said so.
    pub(super) fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// Whether a run was begun and not seen to end.
    pub(super) fn is_in_run(&self) -> bool {
        self.in_run
    }

    /// Sub-CPI and patch of every map that is missing.
    pub(super) fn missing_maps(&self) -> Vec<(u32, u16)> {
        self.intake.missing_maps()
    }

    /// What is to be done now that `event` happened.
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

    /// Takes what came in an exchange.
    fn exchanged(&mut self, now: Instant, outbox: &mut Outbox) -> Result<Step, LinkError> {
        let news = mem::take(&mut self.news);
        self.keep_in_touch(&news, now, outbox)?;
        match self.next(&news, now, outbox)? {
            Some(state) => Ok(self.enter(state, now, outbox)),
            None => self.stay(now, outbox),
        }
    }

    /// Where what came leads; nowhere yet, if it is no answer.
    fn next(
        &mut self,
        news: &News,
        now: Instant,
        outbox: &mut Outbox,
    ) -> Result<Option<State>, LinkError> {
        self.fail_if_refused(news)?;
        let next = match (self.state, &news.status) {
            (State::Greeting, _) => self.greeted(news)?,
            (State::Configuring(setting), Some(status))
                if setting.is_answered_by(status, self.ledger.configuration)? =>
            {
                Some(match setting.next(&self.job) {
                    Some(setting) => State::Configuring(setting),
                    None => self.next_run(),
                })
            }
            (State::Starting, Some(status)) if self.has_begun(status)? => {
                Some(State::Streaming(Stream::new(self.pulses(), *status, now)))
            }
            (State::Streaming(stream), Some(status)) => {
                self.check_mine(status)?;
                self.went_on(stream, *status, now, outbox);
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
            _ => None,
        };
        Ok(next)
    }

    /// Where an error leads: to another configuration, to a new connection, or to the end.
    fn broken(&mut self, error: LinkError, now: Instant, outbox: &mut Outbox) -> Step {
        if self.identity.is_none() {
            // There is nothing to go back to.
            return Step::Over(Err(error));
        }
        let mut error = error;
        match self.state {
            State::Configuring(setting) => {
                error = setting.meaning(error);
                if is_mixed_up(&error) && self.tries.configurations < ATTEMPTS {
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
                self.run_broke_off(None);
            }
            State::Streaming(Stream { told, .. })
            | State::Stopping(told)
            | State::Draining(told, _) => self.run_broke_off(Some(&told)),
            State::Greeting | State::Reconnecting | State::Over => {}
        }
        let given_up = self.tries.fruitless > FRUITLESS || self.tries.recoveries == FRUITLESS;
        if given_up || !error.is_passing() {
            return Step::Over(Err(error));
        }
        self.tries.recoveries += 1;
        match error {
            LinkError::Restarted => self.ledger.counts.restarts += 1,
            _ => self.ledger.counts.reconnects += 1,
        }
        self.state = State::Reconnecting;
        Step::Anew(error)
    }

    /// Goes to a state and does what there is to be done on entering it.
    fn enter(&mut self, state: State, now: Instant, outbox: &mut Outbox) -> Step {
        self.state = state;
        match state {
            State::Greeting => {
                self.times.heard = now;
                self.tries.configurations = 0;
                self.ask_first(now, outbox)
            }
            State::Configuring(setting) => {
                if setting == Setting::Abort {
                    self.ledger.configuration = self.ledger.configuration.wrapping_add(1);
                    self.tries.configurations += 1;
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
            State::Stopping(_) => self.ask_first(now, outbox),
            State::Draining(..) => {
                self.times.advanced = now;
                self.wait()
            }
            State::Reconnecting => self.wait(),
            State::Over => Step::Over(Ok(())),
        }
    }

    /// Stays where it is, asking again where that is due.
    fn stay(&mut self, now: Instant, outbox: &mut Outbox) -> Result<Step, LinkError> {
        let answer = self.ledger.settings.answer;
        match self.state {
            State::Streaming(mut stream) => {
                if self.clock.is_none() {
                    // At a given rate it ends by itself.
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
            State::Draining(told, mut moved) => {
                self.fail_if_stuck(now)?;
                if outbox.backlog() > 0 {
                    moved = now;
                }
                if since(moved, now) > answer {
                    outbox.send(&Command::Status);
                    moved = now;
                }
                self.state = State::Draining(told, moved);
                Ok(self.wait())
            }
            _ => self.ask_again(now, outbox),
        }
    }

    /// Waits for the line.
    fn wait(&self) -> Step {
        Step::Exchange(TICK.min(self.ledger.settings.answer))
    }
}

/// Time that has passed.
fn since(then: Instant, now: Instant) -> Duration {
    now.saturating_duration_since(then)
}
