//! The file header: a line with the format and its version, then `KEY := value` lines up to form feed, newline. CRSD has the same.

use std::collections::BTreeMap;

use super::source::Source;
use subaperture_model::phase_history::ReadError;

/// Ends the header and the XML block.
pub(super) const SECTION_END: &[u8] = b"\x0c\n";

/// Far more than the ten defined keys need; bounds the search for the header's end.
const MAX_HEADER_BYTES: u64 = 1 << 16;

/// A run of bytes that lies within the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) offset: u64,
    pub(crate) size: u64,
}

/// Header values that a reader needs.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) version: String,
    pub(super) classification: Option<String>,
    pub(super) release_info: Option<String>,
    pub(super) xml: Block,
    pub(super) pvp: Block,
    pub(super) signal: Block,
}

impl Header {
    /// Reads the header and checks that every block it names lies within the file.
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        let bytes = first_bytes(source)?;
        Self::parse(&bytes, source.len()).map_err(|what| source.malformed(what))
    }

    /// `bytes` are the first of a file of `file_len`.
    fn parse(bytes: &[u8], file_len: u64) -> Result<Self, String> {
        let lines = Lines::of(bytes, file_len, "CPHD", "CPHD/1.1.0")?;
        let version = version(lines.first)?;
        // Not read, so it may be empty; but a file cut within it is still cut.
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
            xml: lines.block("XML")?,
            pvp: lines.block("PVP")?,
            signal: lines.block("SIGNAL")?,
        })
    }
}

/// The bytes that a header lies in.
pub(crate) fn first_bytes(source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut bytes = vec![0; source.len().min(MAX_HEADER_BYTES) as usize];
    source.read_at(0, &mut bytes)?;
    Ok(bytes)
}

/// The header's text, without what ends it, of a file of this format, which begins as `example` does.
fn header_text<'h>(bytes: &'h [u8], format: &str, example: &str) -> Result<&'h str, String> {
    if bytes.is_empty() {
        return Err("the file is empty; copy it again".to_owned());
    }
    if !bytes.starts_with(format.as_bytes()) {
        let seen: Vec<u8> = bytes[..bytes.len().min(16)].to_vec();
        return Err(format!(
            "byte 0: a {format} file starts with '{example}', this one with '{}'",
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
            "byte 5: version '{version}' is not one of those read here: 1.1.0 and 1.0.x"
        ));
    }
    Ok(version)
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

/// A header's lines: where blocks lie by its keys, and between what they may.
pub(crate) struct Lines<'h> {
    /// The format and its version.
    pub(crate) first: &'h str,
    keys: BTreeMap<&'h str, &'h str>,
    header_len: u64,
    file_len: u64,
}

impl<'h> Lines<'h> {
    /// `bytes` are the first of a file of `file_len`, whose format begins its first line, as in `example`.
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

    fn number(&self, key: &str) -> Result<u64, String> {
        let text = self
            .value(key)
            .ok_or_else(|| format!("header: no {key}; the file cannot be read without"))?;
        text.parse()
            .map_err(|_| format!("header: {key} is '{text}', not a number of bytes"))
    }

    /// The block of this name, if it lies between the header and the end of the file.
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

/// Places the blocks one after another, each on a multiple of 64 bytes. `None` if the file would have
/// more than 2^63 bytes.
pub(super) fn lay_out(sizes: &Sizes, classification: &str, release_info: &str) -> Option<Layout> {
    let after = |offset: u64, size: u64| {
        offset
            .checked_add(size)?
            .checked_next_multiple_of(64)
            .filter(|&end| end < 1 << 63)
    };
    // The header's length depends on the digits of the offsets, and those on its length: begin
    // short and repeat until nothing moves, which it must since offsets only grow.
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
