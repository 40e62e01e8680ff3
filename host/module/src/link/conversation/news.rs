//! Reports received from the module.

use std::time::Instant;

use subaperture_core::link::{
    Command, Damage, LinkCounters, PROTOCOL_VERSION, Refusal, Report, Status,
};

use super::{Conversation, since};
use crate::link::counts::{Counts, growth};
use crate::link::ending::LinkError;
use crate::link::identity::{Identity, printable};
use crate::link::line::Outbox;
use crate::link::settings::Settings;

/// Reports received in one exchange, except maps.
#[derive(Default)]
pub(super) struct News {
    pub(super) identity: Option<Identity>,
    /// Protocol version of a foreign frame.
    pub(super) version: Option<u8>,
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<(u32, Refusal)>,
    /// Whether any valid new frame was received.
    pub(super) any: bool,
    /// Whether a part of a map was received.
    pub(super) map: bool,
    /// Whether a frame was behind in the sequence: its sender restarted.
    pub(super) behind: bool,
}

/// Data kept from one conversation to the next.
pub(in crate::link) struct Ledger {
    pub(in crate::link) settings: Settings,
    pub(in crate::link) counts: Counts,
    /// Link counters in the module's last status.
    module_link: Option<LinkCounters>,
    /// Numbers of the current configuration and run.
    pub(in crate::link) configuration: u32,
    pub(in crate::link) run: u32,
}

impl Ledger {
    pub(in crate::link) fn new(settings: Settings) -> Self {
        Self {
            settings,
            counts: Counts::default(),
            module_link: None,
            configuration: settings.first_number,
            run: settings.first_number,
        }
    }
}

impl Ledger {
    /// Count what the module reports as received.
    pub(in crate::link) fn count(&mut self, status: &Status) {
        let before = self.module_link.unwrap_or(status.link);
        let grown = growth(&before, &status.link);
        self.counts.frames_to_module.add(grown);
        self.module_link = Some(status.link);
    }
}

impl Conversation<'_> {
    /// Process a report of the module. A map that it completes goes to the sink.
    pub(in crate::link) fn hear(&mut self, report: &Report<'_>) -> Result<(), LinkError> {
        self.news.any = true;
        match *report {
            Report::Identity { protocol, .. } if protocol != PROTOCOL_VERSION => {
                self.news.version = Some(protocol);
            }
            Report::Identity {
                arithmetic,
                capacity,
                version,
                ..
            } => {
                self.news.identity = Some(Identity {
                    arithmetic,
                    capacity,
                    version: printable(version),
                });
            }
            Report::Status(status) => {
                self.ledger.count(&status);
                self.news.status = Some(status);
            }
            Report::Refused { sequence, what } => self.news.refusal = Some((sequence, what)),
            Report::Log { .. } | Report::Increment(_) => {}
            _ => {
                self.news.map = true;
                self.intake.take(report, &mut self.ledger.counts)?;
            }
        }
        Ok(())
    }

    /// Process a damaged frame.
    pub(in crate::link) fn hear_damage(&mut self, damage: &Damage) {
        match damage {
            Damage::Repeated(_) => self.news.behind = true,
            Damage::Version(version) => self.news.version = Some(*version),
            Damage::Corrupt | Damage::Malformed | Damage::TooLong => {}
        }
    }

    /// Checks common to all states: a restarted module is asked for its state, one that may have restarted for its identity, and
    /// silence is detected.
    pub(super) fn check_liveness(
        &mut self,
        news: &News,
        now: Instant,
        outbox: &mut Outbox,
    ) -> Result<(), LinkError> {
        let settings = self.ledger.settings;
        if news.any {
            self.times.heard = now;
        }
        if news.map {
            self.times.advanced = now;
        }
        if news.identity.is_some() && self.in_run {
            outbox.send(&Command::Status);
        }
        if news.behind && since(self.times.greeted, now) > settings.answer {
            self.times.greeted = now;
            outbox.send(&Command::Hello);
        }
        // Data sent may still take this long to pass.
        let passing = outbox.clear_at().saturating_duration_since(now);
        if since(self.times.heard, now) > settings.idle + passing {
            return Err(LinkError::Silent);
        }
        Ok(())
    }
}
