//! Header of a CPHD file: version and blocks.

use crate::container::{Blocks, Lines, SECTION_END, Source, lines};
use subaperture_model::phase_history::ReadError;

/// Header values that a reader needs.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) version: String,
    pub(super) classification: Option<String>,
    pub(super) release_info: Option<String>,
    pub(super) blocks: Blocks,
}

impl Header {
    /// Read the header and check that every block it names lies within the file.
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        lines::read(source, Self::parse)
    }

    /// Parse the first `bytes` of a file of `file_len`.
    fn parse(bytes: &[u8], file_len: u64) -> Result<Self, String> {
        let lines = Lines::of(bytes, file_len, "CPHD", "CPHD/1.1.0")?;
        let version = version(lines.first)?;
        // The support block is not read and may be empty, but must lie within the file.
        let no_support = lines
            .value("SUPPORT_BLOCK_SIZE")
            .is_some_and(|s| s.parse() == Ok(0));
        if lines.value("SUPPORT_BLOCK_BYTE_OFFSET").is_some() && !no_support {
            lines.block("SUPPORT")?;
        }
        Ok(Self {
            version: version.to_owned(),
            classification: lines.value("CLASSIFICATION").map(str::to_owned),
            release_info: lines.value("RELEASE_INFO").map(str::to_owned),
            blocks: lines.blocks()?,
        })
    }
}

/// The version of the first line, if it is one of those read here.
fn version(first_line: &str) -> Result<&str, String> {
    let version = first_line.strip_prefix("CPHD/").unwrap_or_default().trim();
    let known = |series: &str| {
        version
            .strip_prefix(series)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    if !(known("1.0") || known("1.1")) {
        return Err(format!(
            "byte 5: expected version 1.1.0 or 1.0.x, found '{version}'"
        ));
    }
    Ok(version)
}

/// Sizes of the blocks of a file to be written.
pub(super) struct Sizes {
    pub(super) xml: u64,
    pub(super) pvp: u64,
    pub(super) signal: u64,
}

/// A header to be written, section end included, and where the blocks begin.
pub(super) struct Layout {
    pub(super) header: String,
    pub(super) xml_offset: u64,
    pub(super) pvp_offset: u64,
    pub(super) signal_offset: u64,
    /// Size of the whole file.
    pub(super) file_bytes: u64,
}

/// Place the blocks one after another at multiples of 64 bytes. `None` if the file would exceed 2^63 bytes.
pub(super) fn lay_out(sizes: &Sizes, classification: &str, release_info: &str) -> Option<Layout> {
    let after = |offset: u64, size: u64| {
        offset
            .checked_add(size)?
            .checked_next_multiple_of(64)
            .filter(|&end| end < 1 << 63)
    };
    // The length of the header depends on the digits of the offsets, and the offsets on that length. Start with the
    // minimum and repeat until nothing changes; offsets only grow, so this ends.
    let mut xml_offset = 0;
    loop {
        let pvp_offset = after(xml_offset, sizes.xml.checked_add(SECTION_END.len() as u64)?)?;
        let signal_offset = after(pvp_offset, sizes.pvp)?;
        after(signal_offset, sizes.signal)?;
        let header = format!(
            "CPHD/1.1.0\n\
             XML_BLOCK_SIZE := {}\n\
             XML_BLOCK_BYTE_OFFSET := {xml_offset}\n\
             PVP_BLOCK_SIZE := {}\n\
             PVP_BLOCK_BYTE_OFFSET := {pvp_offset}\n\
             SIGNAL_BLOCK_SIZE := {}\n\
             SIGNAL_BLOCK_BYTE_OFFSET := {signal_offset}\n\
             CLASSIFICATION := {classification}\n\
             RELEASE_INFO := {release_info}\n\
             \x0c\n",
            sizes.xml, sizes.pvp, sizes.signal
        );
        let needed = after(0, header.len() as u64)?;
        if needed <= xml_offset {
            return Some(Layout {
                header,
                xml_offset,
                pvp_offset,
                signal_offset,
                file_bytes: signal_offset + sizes.signal,
            });
        }
        xml_offset = needed;
    }
}
