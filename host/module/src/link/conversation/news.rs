//! Reports received from the module, and data kept between conversations.

use subaperture_core::link::{LinkCounters, Refusal, Status};

use crate::link::counts::{Counts, growth};
use crate::link::identity::Identity;
use crate::link::settings::Settings;

/// Reports received in one exchange, except products.
#[derive(Default)]
pub(super) struct News {
    pub(super) identity: Option<Identity>,
    /// Protocol version of a foreign frame.
    pub(super) version: Option<u8>,
    pub(super) status: Option<Status>,
    pub(super) refusal: Option<(u32, Refusal)>,
    /// Part of the list of accumulated sub-CPIs received, with the first sub-CPI of the next part.
    pub(super) listed: Option<Option<u32>>,
    /// Whether any valid new frame was received.
    pub(super) any: bool,
    /// Whether a part of a product was received.
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

    /// Count what the module reports as received.
    pub(in crate::link) fn count(&mut self, status: &Status) {
        let before = self.module_link.unwrap_or(status.link);
        let grown = growth(&before, &status.link);
        self.counts.frames_to_module.add(grown);
        self.module_link = Some(status.link);
    }
}
