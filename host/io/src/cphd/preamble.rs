//! Preamble of a file: the header and the XML before its arrays.

use std::path::Path;

use super::header::{Block, Header};
use super::metadata::{self, CphdInfo};
use super::pvp::Layout;
use super::source::Source;
use super::xml::MetadataError;
use crate::xml::{DEFAULT_MEMORY_BYTES, parsed_bytes};
use subaperture_model::phase_history::ReadError;

/// Larger XML blocks are refused: they are parsed in memory. Those of real products have less than
/// a tenth of it.
const MAX_XML_BYTES: u64 = 8 << 20;

/// Header, metadata and where each per-vector parameter lies.
pub(super) struct Preamble {
    pub(super) header: Header,
    pub(super) info: CphdInfo,
    pub(super) layout: Result<Layout, MetadataError>,
    /// The XML's place, for messages.
    pub(super) xml_offset: u64,
}

impl CphdInfo {
    /// Read only the header and the XML of a CPHD file, of any size.
    /// Whether its arrays can be read is left to [`super::Cphd::open`] to check.
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
    /// Reads both, holding at most `memory_bytes`.
    pub(super) fn read(source: &Source, memory_bytes: u64) -> Result<Self, ReadError> {
        let mut header = Header::read(source)?;
        let (mut info, layout) = read_xml(source, header.xml, memory_bytes)?;
        info.version = std::mem::take(&mut header.version);
        info.classification = info.classification.or(header.classification.take());
        info.release_info = info.release_info.or(header.release_info.take());
        Ok(Self {
            xml_offset: header.xml.offset,
            header,
            info,
            layout,
        })
    }
}

fn read_xml(
    source: &Source,
    block: Block,
    memory_bytes: u64,
) -> Result<(CphdInfo, Result<Layout, MetadataError>), ReadError> {
    let xml = read_text(source, block, memory_bytes)?;
    metadata::parse(&xml, memory_bytes).map_err(|e| source.malformed(in_xml(&e, block.offset)))
}

/// The XML block, which takes at most `memory_bytes` once parsed.
pub(crate) fn read_text(
    source: &Source,
    block: Block,
    memory_bytes: u64,
) -> Result<String, ReadError> {
    if block.size > MAX_XML_BYTES {
        return Err(source.malformed(format!(
            "header: XML_BLOCK_SIZE {} is more than the {MAX_XML_BYTES} bytes read here: the \
             header is damaged",
            block.size
        )));
    }
    source.check_memory(block.size, memory_bytes)?;
    let mut bytes = vec![0; block.size as usize];
    source.read_at(block.offset, &mut bytes)?;
    let text = String::from_utf8(bytes).map_err(|e| {
        source.malformed(format!(
            "byte {}: the XML block is not UTF-8 text; copy the file again",
            block.offset + e.utf8_error().valid_up_to() as u64
        ))
    })?;
    source.check_memory(parsed_bytes(&text), memory_bytes)?;
    Ok(text)
}

/// An error of the XML with the place of its block.
pub(crate) fn in_xml(error: &MetadataError, offset: u64) -> String {
    format!("{error} (XML block at byte {offset})")
}
