//! Channel of a CPHD file to be written.

use super::antenna_fit::Described;
use super::prepare::Prepared;
use super::write_options::Channel;

/// A channel, ready, and where its arrays begin in their blocks.
pub(super) struct Entry<'a> {
    pub(super) channel: &'a Channel<'a>,
    pub(super) prepared: Prepared,
    pub(super) pvp_offset: u64,
    pub(super) signal_offset: u64,
    /// Antennas to be described.
    pub(super) antennas: Option<Described<'a>>,
}
