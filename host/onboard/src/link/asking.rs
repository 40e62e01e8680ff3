//! Questions and answers of a run that goes message by message: what is asked is sent until its answer comes.
//!
//! For runs that bring something small for every message, increments and range profiles: the next message goes when what the one before
//! brings has come. Runs that bring maps stream, and are led by [`super::conversation`].
//!
//! **Errors** [`LinkError`]: a refusal, another protocol, silence, a stop that somebody wants.

use std::time::{Duration, Instant};

use num_complex::Complex32;
use subaperture_core::link::{
    Command, Damage, Increment, PROTOCOL_VERSION, ProfileAssembly, ProfileHeader, Refusal, Report,
    State, Status,
};

use super::conversation::TICK;
use super::ending::LinkError;
use super::identity::shown;
use super::session::{Session, Watch};

/// So often at least, and for [`super::Settings::idle`], something is asked for.
pub(super) const LEAST_TRIES: u32 = 3;

/// What has been heard since it was last looked at.
#[derive(Default)]
pub(super) struct News {
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<Refusal>,
    pub(super) increment: Option<Increment>,
    /// A profile that came whole.
    pub(super) profile: Option<(ProfileHeader, Vec<Complex32>)>,
    /// A part of one.
    pub(super) profile_goes_on: bool,
}

impl Session<'_> {
    /// Sends commands, again and again, until a status says what is waited for: that status.
    pub(super) fn ask(
        &mut self,
        commands: &[Command<'_>],
        watch: &mut dyn Watch,
        is_done: impl Fn(&Status) -> bool,
    ) -> Result<Status, LinkError> {
        let settings = self.ledger.settings;
        let begun = Instant::now();
        let mut refused = None;
        for tries in 1u32.. {
            for command in commands {
                self.way.line.outbox.send(command);
            }
            let asked = Instant::now();
            while self.waits(asked) {
                let news = self.hear(None, watch)?;
                match news.refusal {
                    // The command before it may have been lost.
                    Some(Refusal::NotConfigured | Refusal::Running) => refused = news.refusal,
                    Some(refusal) => return Err(LinkError::Refused(refusal)),
                    None => {}
                }
                if let Some(status) = news.status.filter(&is_done) {
                    self.way.line.outbox.is_clear();
                    return Ok(status);
                }
            }
            if tries >= LEAST_TRIES && begun.elapsed() > settings.idle {
                break;
            }
        }
        Err(refused.map_or(LinkError::Silent, LinkError::Refused))
    }

    /// Numbers of a configuration and of a run that none before had.
    pub(super) fn next_run(&mut self) -> (u32, u32) {
        let ledger = &mut self.ledger;
        ledger.configuration = ledger.configuration.wrapping_add(1);
        ledger.run = ledger.run.wrapping_add(1);
        (ledger.configuration, ledger.run)
    }

    /// Tells the module what it is to do, after the end of what an earlier session may have left, and starts the run.
    pub(super) fn start(
        &mut self,
        (id, run): (u32, u32),
        configure: &[Command<'_>],
        watch: &mut dyn Watch,
    ) -> Result<(), LinkError> {
        self.ask(&[&[Command::Abort], configure].concat(), watch, |status| {
            status.configuration == id && status.state == State::Ready
        })?;
        self.ask(&[Command::Start { run, first: 0 }], watch, |status| {
            status.run == run && status.state == State::Running
        })?;
        self.ledger.counts.runs += 1;
        Ok(())
    }

    /// Ends the run, and counts what the module says of it.
    pub(super) fn stop(&mut self, run: u32, watch: &mut dyn Watch) -> Result<(), LinkError> {
        let last = self.ask(&[Command::Stop], watch, |status| {
            status.run == run && status.state == State::Done
        })?;
        self.ledger.counts.module_pulses.add(&last.pulses);
        Ok(())
    }

    /// So that the next session finds a module that waits, where a run ended badly.
    pub(super) fn leave<T>(&mut self, ending: Result<T, LinkError>) -> Result<T, LinkError> {
        if ending.is_err() {
            self.way.abort(self.ledger.settings.answer);
        }
        ending
    }

    /// Whether an answer to what was sent then may still come in time.
    pub(super) fn waits(&self, asked: Instant) -> bool {
        let outbox = &self.way.line.outbox;
        let answer = self.ledger.settings.answer;
        outbox.backlog() > 0 || outbox.clear_at().max(asked).elapsed() < answer
    }

    /// Writes and reads once, waiting for answers; parts of profiles are put together where somebody waits for one.
    pub(super) fn hear(
        &mut self,
        profiles: Option<&mut ProfileAssembly<'_>>,
        watch: &mut dyn Watch,
    ) -> Result<News, LinkError> {
        self.hear_for(TICK, profiles, watch)
    }

    /// The same, waiting so long at most.
    pub(super) fn hear_for(
        &mut self,
        wait: Duration,
        mut profiles: Option<&mut ProfileAssembly<'_>>,
        watch: &mut dyn Watch,
    ) -> Result<News, LinkError> {
        if watch.cancelled() {
            return Err(LinkError::Cancelled);
        }
        let wait = wait.min(self.ledger.settings.answer);
        let mut news = News::default();
        let mut behind = false;
        let mut bytes = self.way.line.exchange(wait)?;
        while let Some(frame) = self.way.receiver.receive::<Report<'_>>(&mut bytes) {
            match frame.map(|frame| frame.message) {
                Ok(Report::Identity { protocol, .. }) if protocol != PROTOCOL_VERSION => {
                    return Err(LinkError::Version(protocol));
                }
                Ok(Report::Status(status)) => {
                    self.ledger.count(&status);
                    news.status = Some(status);
                }
                Ok(Report::Refused { what, .. }) => news.refusal = Some(what),
                Ok(Report::Log { text }) => watch.log(&shown(text)),
                Ok(Report::Increment(increment)) => news.increment = Some(increment),
                Ok(report) => {
                    if let Some(assembly) = &mut profiles {
                        news.profile_goes_on = true;
                        // One that is lost is asked for again.
                        if let Ok(Some(whole)) = assembly.take(&report) {
                            news.profile = Some((whole.header, whole.values().collect()));
                        }
                    }
                }
                Err(Damage::Version(version)) => return Err(LinkError::Version(version)),
                // It began anew, and what it says is heard again once it has been greeted.
                Err(Damage::Repeated(_)) => behind = true,
                Err(Damage::Corrupt | Damage::Malformed | Damage::TooLong) => {}
            }
        }
        if behind {
            self.way.line.outbox.send(&Command::Hello);
        }
        watch.update(&self.counts());
        Ok(news)
    }
}
