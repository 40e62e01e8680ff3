//! What comes from the module.

use std::time::Instant;

use subaperture_core::link::{
    Command, Damage, LinkCounters, PROTOCOL_VERSION, Refusal, Report, Status,
};

use super::{Conversation, since};
use crate::link::counts::{Counts, growth};
use crate::link::ending::LinkError;
use crate::link::identity::{Identity, shown};
use crate::link::line::Outbox;
use crate::link::settings::Settings;

/// What came in one exchange, apart from maps.
#[derive(Default)]
pub(super) struct News {
    pub(super) identity: Option<Identity>,
    /// Another protocol's version.
    pub(super) version: Option<u8>,
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<(u32, Refusal)>,
    /// Any frame that is whole and new.
    pub(super) any: bool,
    /// A part of a map.
    pub(super) map: bool,
    /// A frame that is behind in the sequence: its sender began to count anew.
    pub(super) behind: bool,
}

/// What a session keeps from one conversation to the next.
pub(in crate::link) struct Ledger {
    pub(in crate::link) settings: Settings,
    pub(in crate::link) counts: Counts,
    /// The module's counters by its last status.
    module_link: Option<LinkCounters>,
    /// Numbers of the configuration and the run that are in force.
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
    /// Counts what the module says that it has received.
    pub(in crate::link) fn count(&mut self, status: &Status) {
        let before = self.module_link.unwrap_or(status.link);
        let grown = growth(&before, &status.link);
        self.counts.frames_to_module.add(grown);
        self.module_link = Some(status.link);
    }
}

impl Conversation<'_> {
    /// Takes a report of the module. A map that it completes goes to the sink.
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
                    version: shown(version),
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

    /// Takes a frame that is no report.
    pub(in crate::link) fn mishear(&mut self, damage: &Damage) {
        match damage {
            Damage::Repeated(_) => self.news.behind = true,
            Damage::Version(version) => self.news.version = Some(*version),
            Damage::Corrupt | Damage::Malformed | Damage::TooLong => {}
        }
    }

    /// What holds in any state: a module that began anew is asked how it stands, one that may have begun
    /// anew who it is, and one that says nothing is silent.
    pub(super) fn keep_in_touch(
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
        // What was sent may still take that long to pass.
        let passing = outbox.clear_at().saturating_duration_since(now);
        if since(self.times.heard, now) > settings.idle + passing {
            return Err(LinkError::Silent);
        }
        Ok(())
    }
}
