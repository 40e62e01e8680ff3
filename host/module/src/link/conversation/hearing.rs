//! Processing of reports of the module.

use std::time::Instant;

use subaperture_core::link::{Command, Damage, PROTOCOL_VERSION, Report};

use super::news::News;
use super::{Conversation, State, since};
use crate::link::ending::LinkError;
use crate::link::identity::{Identity, printable};
use crate::link::line::Outbox;

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
                image,
                version,
                ..
            } => {
                self.news.identity = Some(Identity {
                    arithmetic,
                    capacity,
                    image,
                    version: printable(version),
                });
            }
            Report::Status(status) => {
                self.ledger.count(&status);
                self.ledger.counts.maps_processed = status.maps.into();
                self.news.status = Some(status);
            }
            Report::Refused { sequence, what } => self.news.refusal = Some((sequence, what)),
            Report::Accumulated { first, bits } if matches!(self.state, State::Listing(next) if next == first) =>
            {
                let counts = &mut self.ledger.counts;
                self.news.listed = Some(self.intake.take_accumulated(first, bits, counts)?);
            }
            Report::Accumulated { .. } | Report::Event(_) | Report::Increment(_) => {}
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
