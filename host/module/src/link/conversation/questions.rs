//! Requests: commands that are repeated until an answer confirms them.

use std::time::Instant;

use subaperture_core::link::{Command, Refusal, Status};

use super::configuring::{Setting, WEIGHT_BYTES};
use super::news::News;
use super::question::ATTEMPTS;
use super::{Conversation, State, Step, since};
use crate::link::ending::LinkError;
use crate::link::line::Outbox;

impl Conversation<'_> {
    // Requests.

    /// Send the request of the current state for the first time.
    pub(super) fn ask_first(&mut self, now: Instant, outbox: &mut Outbox) -> Step {
        self.question.unanswered = 0;
        self.ask(now, outbox);
        self.wait()
    }

    /// Repeat the request if its answer is overdue.
    pub(super) fn ask_again(
        &mut self,
        now: Instant,
        outbox: &mut Outbox,
    ) -> Result<Step, LinkError> {
        if outbox.backlog() > 0 {
            self.question.asked = now;
        }
        if since(self.question.asked, now) < self.ledger.settings.answer {
            return Ok(self.wait());
        }
        let (attempts, is_greeting) = match self.state {
            State::Configuring(setting) => (setting.attempts(ATTEMPTS), false),
            State::Greeting => (ATTEMPTS, true),
            _ => (ATTEMPTS, false),
        };
        // A request waits behind all data sent before it and does not count as unanswered yet.
        self.question.unanswered += u32::from(is_greeting || now >= outbox.clear_at());
        if self.question.unanswered >= attempts {
            return Err(LinkError::Silent);
        }
        self.ask(now, outbox);
        Ok(self.wait())
    }

    fn ask(&mut self, now: Instant, outbox: &mut Outbox) {
        let mut bytes = [0; WEIGHT_BYTES];
        let command = match self.state {
            State::Greeting => {
                self.times.greeted = now;
                Command::Hello
            }
            State::Configuring(setting) => {
                setting.command(self.ledger.configuration, &self.job, &mut bytes)
            }
            State::Starting => {
                let (run, first) = (self.ledger.run, self.pulses().start);
                match self.job.from_front_end {
                    true => Command::StartFrontEnd { run, first },
                    false => Command::Start { run, first },
                }
            }
            State::Stopping(_) => Command::Stop,
            State::Listing(first) => Command::Accumulated { first },
            State::Collecting(patch) => Command::SendChip { patch },
            State::Streaming(_) | State::Draining(..) | State::Reconnecting | State::Over => {
                Command::Status
            }
        };
        self.question.sequence = outbox.send(&command);
        self.question.asked = now;
    }

    /// Fail if the module refused the request, or the first pulse of the run.
    pub(super) fn fail_if_refused(&self, news: &News) -> Result<(), LinkError> {
        let Some((sequence, what)) = news.refusal else {
            return Ok(());
        };
        let concerns = match self.state {
            State::Configuring(_)
            | State::Starting
            | State::Stopping(_)
            | State::Listing(_)
            | State::Collecting(_) => sequence == self.question.sequence,
            State::Streaming(_) | State::Draining(..) => {
                matches!(what, Refusal::Encoding | Refusal::PulseLength { .. })
            }
            State::Greeting | State::Reconnecting | State::Over => false,
        };
        match concerns {
            true => Err(LinkError::Refused(what)),
            false => Ok(()),
        }
    }

    /// Fail if the status belongs to another run: the module has restarted.
    pub(super) fn check_mine(&self, status: &Status) -> Result<(), LinkError> {
        match (status.configuration, status.run) == (self.ledger.configuration, self.ledger.run) {
            true => Ok(()),
            false => Err(LinkError::Restarted),
        }
    }

    // Greeting.

    /// Process the module's identity.
    pub(super) fn greeted(&mut self, news: &News) -> Result<Option<State>, LinkError> {
        match (&news.identity, news.version, &self.identity) {
            (None, Some(version), _) => Err(LinkError::Version(version)),
            (None, None, _) => Ok(None),
            (Some(identity), _, None) => {
                self.identity = Some(identity.clone());
                Ok(Some(State::Over))
            }
            (Some(now), _, Some(before))
                if (now.capacity, now.arithmetic) == (before.capacity, before.arithmetic) =>
            {
                Ok(Some(State::Configuring(Setting::Abort)))
            }
            // Not the module that the run was planned for.
            (Some(_), _, Some(_)) => Err(LinkError::Refused(Refusal::Unsupported)),
        }
    }
}
