//! Text header of CPHD and CRSD: a line with the format and its version, then `KEY := value` lines up to form feed, newline.

use std::collections::BTreeMap;

use super::{Block, MetadataError, Source};
use subaperture_model::phase_history::ReadError;

/// End of the header and of the XML block.
pub(crate) const SECTION_END: &[u8] = b"\x0c\n";

/// Far more than the ten defined keys need; bounds the search for the header's end.
const MAX_HEADER_BYTES: u64 = 1 << 16;

/// Larger XML blocks are refused: they are parsed in memory. Those of real products have less than
/// a tenth of it.
const MAX_XML_BYTES: u64 = 8 << 20;

/// Blocks that both formats have.
#[derive(Debug)]
pub(crate) struct Blocks {
    pub(crate) xml: Block,
    /// Per-vector parameters.
    pub(crate) pvp: Block,
    pub(crate) signal: Block,
}

/// Read the header; `parse` is given the first bytes of the file and the file's length.
pub(crate) fn read<T>(
    source: &Source,
    parse: impl FnOnce(&[u8], u64) -> Result<T, String>,
) -> Result<T, ReadError> {
    let size = source.len().min(MAX_HEADER_BYTES);
    let bytes = source.bytes(0, size, "a header")?;
    parse(&bytes, source.len()).map_err(|what| source.malformed(what))
}

/// Text of the header without its end, of a file of this format, whose first line is like `example`.
fn header_text<'h>(bytes: &'h [u8], format: &str, example: &str) -> Result<&'h str, String> {
    if bytes.is_empty() {
        return Err("the file is empty; copy it again".to_owned());
    }
    if !bytes.starts_with(format.as_bytes()) {
        let seen: Vec<u8> = bytes[..bytes.len().min(16)].to_vec();
        return Err(format!(
            "byte 0: expected '{example}' at the start of a {format} file, found '{}'",
            seen.escape_ascii()
        ));
    }
    let end = bytes
        .windows(SECTION_END.len())
        .position(|w| w == SECTION_END)
        .ok_or_else(|| {
            format!(
                "byte 0: no end of the header (form feed, newline) within {} bytes: the file \
                 is cut short or not {format}; copy it again",
                bytes.len()
            )
        })?;
    std::str::from_utf8(&bytes[..end])
        .map_err(|e| format!("byte {}: the header is not text", e.valid_up_to()))
}

/// Keys and values of the lines after the first.
fn keys(text: &str) -> Result<BTreeMap<&str, &str>, String> {
    let mut keys = BTreeMap::new();
    let mut at = 0;
    for line in text.split('\n') {
        if at > 0 && !line.is_empty() {
            let (key, value) = line
                .split_once(":=")
                .ok_or_else(|| format!("byte {at}: header line '{line}' is not 'KEY := value'"))?;
            if keys.insert(key.trim(), value.trim()).is_some() {
                return Err(format!(
                    "byte {at}: header key {} is given twice",
                    key.trim()
                ));
            }
        }
        at += line.len() + 1;
    }
    Ok(keys)
}

/// Keys of a header, and the bytes between which blocks may lie.
pub(crate) struct Lines<'h> {
    /// The format and its version.
    pub(crate) first: &'h str,
    keys: BTreeMap<&'h str, &'h str>,
    header_len: u64,
    file_len: u64,
}

impl<'h> Lines<'h> {
    /// Parse the first `bytes` of a file of `file_len`, whose first line begins with the format, as in `example`.
    pub(crate) fn of(
        bytes: &'h [u8],
        file_len: u64,
        format: &str,
        example: &str,
    ) -> Result<Self, String> {
        let text = header_text(bytes, format, example)?;
        Ok(Self {
            first: text.split('\n').next().unwrap_or_default(),
            keys: keys(text)?,
            header_len: (text.len() + SECTION_END.len()) as u64,
            file_len,
        })
    }

    /// Value of a header key.
    pub(crate) fn value(&self, key: &str) -> Option<&'h str> {
        self.keys.get(key).copied()
    }

    /// Blocks that both formats have.
    pub(crate) fn blocks(&self) -> Result<Blocks, String> {
        Ok(Blocks {
            xml: self.block("XML")?,
            pvp: self.block("PVP")?,
            signal: self.block("SIGNAL")?,
        })
    }

    fn number(&self, key: &str) -> Result<u64, String> {
        let text = self
            .value(key)
            .ok_or_else(|| format!("header: required key {key} is missing"))?;
        text.parse()
            .map_err(|_| format!("header: {key}: expected a number of bytes, found '{text}'"))
    }

    /// Block of this name, which must lie between the header and the end of the file.
    pub(crate) fn block(&self, name: &str) -> Result<Block, String> {
        let Self {
            header_len,
            file_len,
            ..
        } = self;
        let size = self.number(&format!("{name}_BLOCK_SIZE"))?;
        let offset = self.number(&format!("{name}_BLOCK_BYTE_OFFSET"))?;
        if size == 0 {
            return Err(format!(
                "header: {name}_BLOCK_SIZE is 0: the block is empty"
            ));
        }
        if offset < *header_len {
            return Err(format!(
                "header: {name}_BLOCK_BYTE_OFFSET {offset} lies within the header, which ends \
                 at byte {header_len}"
            ));
        }
        match offset.checked_add(size) {
            Some(end) if end <= *file_len => Ok(Block { offset, size }),
            _ => Err(format!(
                "header: the {name} block takes {size} bytes from byte {offset} on, but the \
                 file ends at byte {file_len}: it is cut short; copy it again"
            )),
        }
    }
}

/// Read the XML block, which takes at most `memory_bytes` once parsed.
pub(crate) fn read_xml(
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
    source.xml(block, memory_bytes)
}

/// Error about the XML of a file, with the position of its block.
pub(crate) fn in_xml(source: &Source, xml: Block, error: &MetadataError) -> ReadError {
    source.malformed(format!("{error} (XML block at byte {})", xml.offset))
}
