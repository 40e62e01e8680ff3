//! Request-response runs: each request is repeated until its answer is received.
//!
//! For runs whose messages each produce one small result, motion increments and range profiles: the next message is sent after
//! the result of the previous one. Runs that produce maps stream pulses and are controlled by [`super::conversation`].
//!
//! **Errors**: [`LinkError`] for a refusal, another protocol version, silence, or cancellation.

use std::time::{Duration, Instant};

use num_complex::Complex32;
use subaperture_core::link::{
    Command, Damage, Increment, PROTOCOL_VERSION, ProfileAssembly, ProfileHeader, Refusal, Report,
    State, Status,
};

use super::conversation::TICK;
use super::ending::LinkError;
use super::session::{Session, SessionObserver};

/// Minimum number of attempts, in addition to the time limit [`super::Settings::idle`].
pub(super) const MIN_TRIES: u32 = 3;

/// Reports received since the last check.
#[derive(Default)]
pub(super) struct News {
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<Refusal>,
    pub(super) increments: Vec<Increment>,
    /// Completely received profile.
    pub(super) profile: Option<(ProfileHeader, Vec<Complex32>)>,
    /// Whether a part of a profile was received.
    pub(super) profile_goes_on: bool,
}

impl Session<'_> {
    /// Repeat commands until a status satisfies the condition, and return that status.
    pub(super) fn ask(
        &mut self,
        commands: &[Command<'_>],
        watch: &mut dyn SessionObserver,
        is_done: impl Fn(&Status) -> bool,
    ) -> Result<Status, LinkError> {
        let settings = self.ledger.settings;
        let begun = Instant::now();
        let mut refused = None;
        for tries in 1u32.. {
            for command in commands {
                self.connection.line.outbox.send(command);
            }
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(None, watch)?;
                match news.refusal {
                    // The preceding command may have been lost.
                    Some(Refusal::NotConfigured | Refusal::Running) => refused = news.refusal,
                    Some(refusal) => return Err(LinkError::Refused(refusal)),
                    None => {}
                }
                if let Some(status) = news.status.filter(&is_done) {
                    self.connection.line.outbox.is_clear();
                    return Ok(status);
                }
            }
            if tries >= MIN_TRIES && begun.elapsed() > settings.idle {
                break;
            }
        }
        Err(refused.map_or(LinkError::Silent, LinkError::Refused))
    }

    /// Time from a request of the status to its arrival.
    pub(crate) fn round_trip(
        &mut self,
        watch: &mut dyn SessionObserver,
    ) -> Result<Duration, LinkError> {
        let asked = Instant::now();
        self.ask(&[Command::Status], watch, |_| true)?;
        Ok(asked.elapsed())
    }

    /// Time after which a request is repeated.
    pub(crate) fn answer(&self) -> Duration {
        self.ledger.settings.answer
    }

    /// New numbers for a configuration and a run.
    pub(super) fn next_run(&mut self) -> (u32, u32) {
        let ledger = &mut self.ledger;
        ledger.configuration = ledger.configuration.wrapping_add(1);
        ledger.run = ledger.run.wrapping_add(1);
        (ledger.configuration, ledger.run)
    }

    /// End any run of an earlier session, configure the module, and start the run.
    pub(super) fn start(
        &mut self,
        (id, run): (u32, u32),
        configure: &[Command<'_>],
        start: Command<'_>,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        if let least @ Some(_) = self.ledger.settings.events {
            self.connection.line.outbox.send(&Command::Log { least });
        }
        self.ask(&[&[Command::Abort], configure].concat(), watch, |status| {
            status.configuration == id && status.state == State::Ready
        })?;
        self.ask(&[start], watch, |status| {
            status.run == run && status.state == State::Running
        })?;
        self.ledger.counts.runs += 1;
        Ok(())
    }

    /// End the run and count what the module reports about it.
    pub(super) fn stop(
        &mut self,
        run: u32,
        watch: &mut dyn SessionObserver,
    ) -> Result<(), LinkError> {
        let last = self.ask(&[Command::Stop], watch, |status| {
            status.run == run && status.state == State::Done
        })?;
        self.ledger.counts.module_pulses.add(&last.pulses);
        Ok(())
    }

    /// After a failed run: abort it, so that the next session finds an idle module.
    pub(super) fn leave<T>(&mut self, ending: Result<T, LinkError>) -> Result<T, LinkError> {
        if ending.is_err() {
            self.connection.abort(self.ledger.settings.answer);
        }
        ending
    }

    /// Whether the answer to a request sent at `asked` may still arrive in time.
    pub(super) fn waits(&self, asked: Instant) -> bool {
        self.waits_for(asked, self.ledger.settings.answer)
    }

    /// Whether the answer to a request sent at `asked` may still arrive in time, if it takes the module at most `answer`.
    pub(super) fn waits_for(&self, asked: Instant, answer: Duration) -> bool {
        let outbox = &self.connection.line.outbox;
        outbox.backlog() > 0 || outbox.clear_at().max(asked).elapsed() < answer
    }

    /// Exchange bytes once, waiting for answers. Parts of profiles are reassembled if `profiles` is given.
    pub(super) fn hear(
        &mut self,
        profiles: Option<&mut ProfileAssembly<'_>>,
        watch: &mut dyn SessionObserver,
    ) -> Result<News, LinkError> {
        self.hear_for(TICK, profiles, watch)
    }

    /// Like `hear`, waiting at most `wait`.
    pub(super) fn hear_for(
        &mut self,
        wait: Duration,
        mut profiles: Option<&mut ProfileAssembly<'_>>,
        watch: &mut dyn SessionObserver,
    ) -> Result<News, LinkError> {
        if watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let wait = wait.min(self.ledger.settings.answer);
        let mut news = News::default();
        let mut behind = false;
        let mut bytes = self.connection.line.exchange(wait)?;
        while let Some(frame) = self.connection.receiver.receive::<Report<'_>>(&mut bytes) {
            match frame.map(|frame| frame.message) {
                Ok(Report::Identity { protocol, .. }) if protocol != PROTOCOL_VERSION => {
                    return Err(LinkError::Version(protocol));
                }
                Ok(Report::Status(status)) => {
                    self.ledger.count(&status);
                    news.status = Some(status);
                }
                Ok(Report::Refused { what, .. }) => news.refusal = Some(what),
                Ok(Report::Event(event)) => watch.event(&event),
                Ok(Report::Increment(increment)) => news.increments.push(increment),
                Ok(report) => {
                    if let Some(assembly) = &mut profiles {
                        news.profile_goes_on = true;
                        // A lost profile is requested again.
                        if let Ok(Some(whole)) = assembly.take(&report) {
                            news.profile = Some((whole.header, whole.values().collect()));
                        }
                    }
                }
                Err(Damage::Version(version)) => return Err(LinkError::Version(version)),
                // The module restarted. After a greeting its reports are accepted again.
                Err(Damage::Repeated(_)) => behind = true,
                Err(Damage::Corrupt | Damage::Malformed | Damage::TooLong) => {}
            }
        }
        if behind {
            self.connection.line.outbox.send(&Command::Hello);
        }
        watch.update(&self.counts());
        Ok(news)
    }
}
