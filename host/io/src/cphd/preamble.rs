//! Preamble of a CPHD file: the header and the XML before its arrays.

use std::path::Path;

use super::header::Header;
use super::metadata::{self, CphdInfo};
use super::pvp::Layout;
use crate::container::lines::{in_xml, read_xml};
use crate::container::{MetadataError, Source};
use crate::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::phase_history::ReadError;

/// Header, metadata and positions of the per-vector parameters.
pub(super) struct Preamble {
    pub(super) header: Header,
    pub(super) info: CphdInfo,
    pub(super) layout: Result<Layout, MetadataError>,
}

impl CphdInfo {
    /// Read only the header and the XML of a CPHD file of any size. The arrays are checked by [`super::Cphd::open`].
    ///
    /// # Errors
    /// [`ReadError::Io`]; [`ReadError::Malformed`] if it is not CPHD, is cut short, or the XML lacks
    /// what [`CphdInfo`] needs.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        Self::read_within(path, DEFAULT_MEMORY_BYTES)
    }

    /// As [`Self::read`], with XML that takes at most `memory_bytes` once parsed.
    ///
    /// # Errors
    /// As [`Self::read`]; [`ReadError::Memory`].
    pub fn read_within(path: impl AsRef<Path>, memory_bytes: u64) -> Result<Self, ReadError> {
        let source = Source::open(path.as_ref())?;
        Ok(Preamble::read(&source, memory_bytes)?.info)
    }
}

impl Preamble {
    /// Read both, holding at most `memory_bytes`.
    pub(super) fn read(source: &Source, memory_bytes: u64) -> Result<Self, ReadError> {
        let mut header = Header::read(source)?;
        let xml = read_xml(source, header.blocks.xml, memory_bytes)?;
        let (mut info, layout) = metadata::parse(&xml, memory_bytes)
            .map_err(|error| in_xml(source, header.blocks.xml, &error))?;
        info.version = std::mem::take(&mut header.version);
        info.classification = info.classification.or(header.classification.take());
        info.release_info = info.release_info.or(header.release_info.take());
        Ok(Self {
            header,
            info,
            layout,
        })
    }
}
