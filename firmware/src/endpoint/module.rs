//! State of an endpoint, without its receiver.

use subaperture_core::link::{Encoder, Refusal, State};
use subaperture_core::stream::SubCpiProcessor;

use super::events::Events;
use super::front_end::Source;
use super::increments::Increments;
use super::profiles::Profiles;
use super::transfer::Transfer;
use crate::engine::WireEngine;
use crate::products::Products;

/// Reports to send as soon as the line is free.
#[derive(Debug)]
pub(super) struct Due {
    pub(super) identity: bool,
    pub(super) status: bool,
    /// First sub-CPI of a list of accumulated sub-CPIs.
    pub(super) accumulated: Option<u32>,
    pub(super) refusal: Option<(u32, Refusal)>,
}

/// Everything except the receiver, since commands borrow from its buffer.
pub(super) struct Module<'a, E: WireEngine> {
    pub(super) processor: SubCpiProcessor<'a, E>,
    pub(super) products: Products<'a>,
    pub(super) encoder: Encoder,
    pub(super) frame: &'a mut [u8],
    pub(super) row: &'a mut [u8],
    /// Range of `frame` still to be sent.
    pub(super) pending: (usize, usize),
    pub(super) version: &'static str,
    pub(super) due: Due,
    pub(super) configuration: u32,
    /// Number of weights received, and number of patches announced.
    pub(super) weights: usize,
    pub(super) patches: u16,
    /// Number of pulses of all runs; 0 if unknown.
    pub(super) total_pulses: u32,
    pub(super) send_maps: bool,
    pub(super) run: Option<u32>,
    pub(super) state: State,
    pub(super) maps: u32,
    pub(super) reported_credit: u32,
    pub(super) transfer: Transfer,
    /// Whether the run ends as soon as no sub-CPI is partly accumulated.
    pub(super) aborting: bool,
    /// Patch of the chip in transfer, and number of chips requested in this configuration.
    pub(super) chip: u16,
    pub(super) chips_requested: u32,
    /// A refused pulse of the run was already reported to the host.
    pub(super) pulse_refused: bool,
    pub(super) increments: Increments<'a>,
    pub(super) profiles: Profiles<'a>,
    pub(super) source: Source<'a>,
    pub(super) events: Events,
}
