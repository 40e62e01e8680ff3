//! Writer of XML elements, indented and escaped; checks of XML before it is parsed ([`check`]).

use glam::DVec3;
use subaperture_model::quantity::bytes;

/// Writes indented elements.
#[derive(Debug)]
pub struct Writer {
    text: String,
    depth: usize,
}

impl Default for Writer {
    fn default() -> Self {
        Self::new()
    }
}

impl Writer {
    /// A document that begins with its declaration.
    pub fn new() -> Self {
        Self {
            text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned(),
            depth: 0,
        }
    }

    /// The document.
    pub fn finish(self) -> String {
        self.text
    }

    /// An element with children. `attributes` are plain ASCII of our own making.
    pub fn element(&mut self, name: &str, attributes: &str, content: impl FnOnce(&mut Self)) {
        let space = if attributes.is_empty() { "" } else { " " };
        self.indent();
        self.text += &format!("<{name}{space}{attributes}>\n");
        self.depth += 1;
        content(self);
        self.depth -= 1;
        self.indent();
        self.text += &format!("</{name}>\n");
    }

    /// An element with text, escaped.
    pub fn text(&mut self, name: &str, value: impl std::fmt::Display) {
        self.text_with(name, "", value);
    }

    /// An element with attributes and text, which is escaped.
    pub fn text_with(&mut self, name: &str, attributes: &str, value: impl std::fmt::Display) {
        let space = if attributes.is_empty() { "" } else { " " };
        self.indent();
        self.text += &format!("<{name}{space}{attributes}>");
        for c in value.to_string().chars() {
            match c {
                '&' => self.text += "&amp;",
                '<' => self.text += "&lt;",
                '>' => self.text += "&gt;",
                c => self.text.push(c),
            }
        }
        self.text += &format!("</{name}>\n");
    }

    /// An element with a number, in the fewest digits that read back to the same float64.
    pub fn number(&mut self, name: &str, value: f64) {
        self.text(name, format_args!("{value:?}"));
    }

    /// Elements with a number each.
    pub fn numbers(&mut self, values: &[(&str, f64)]) {
        for (name, value) in values {
            self.number(name, *value);
        }
    }

    /// An element with three.
    pub fn xyz(&mut self, name: &str, v: DVec3) {
        self.element(name, "", |w| {
            w.numbers(&[("X", v.x), ("Y", v.y), ("Z", v.z)]);
        });
    }

    fn indent(&mut self) {
        self.text.extend(std::iter::repeat_n("  ", self.depth));
    }
}

/// Attributes that an element may have, and declarations of namespaces a document: the standard's have two of
/// each at most. A parser compares every one with every other.
const MAX_ATTRIBUTES: usize = 100;

/// Memory of parsed XML where no other limit is given, bytes.
pub const DEFAULT_MEMORY_BYTES: u64 = 1 << 30;

/// Memory that an opening bracket may take: an element and a text of the parser's tree in a list that grows by doubling, and what readers
/// keep of an element.
const NODE_BYTES: u64 = 200;
/// Memory that an equals sign may take: an attribute.
const ATTRIBUTE_BYTES: u64 = 100;
/// Memory that an ampersand may take, beside its text: a string of its own.
const ESCAPE_BYTES: u64 = 64;
/// Copies of a byte of text: the text, unescaped text, and what readers keep of it.
const COPIES: u64 = 3;

/// Reason for which XML is not parsed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum XmlFault {
    /// It would take a parser long, or is damaged.
    #[error("{0}")]
    Damaged(String),
    /// It would take too much memory.
    #[error(
        "expected XML that takes at most {} of memory, found one that would need {}: allow more memory, or take the file of fewer channels",
        bytes((*allowed_bytes).into()), bytes((*needed_bytes).into())
    )]
    Memory {
        /// Memory that the parsed text may need, bytes.
        needed_bytes: u64,
        /// Memory limit of the caller, bytes.
        allowed_bytes: u64,
    },
}

/// Memory that XML may take once it is parsed, bytes: an upper bound from the number of its brackets, equals signs and ampersands.
pub fn parsed_bytes(xml: &str) -> u64 {
    let mut bytes = COPIES * xml.len() as u64;
    for byte in xml.bytes() {
        bytes += match byte {
            b'<' => NODE_BYTES,
            b'=' => ATTRIBUTE_BYTES,
            b'&' => ESCAPE_BYTES,
            _ => 0,
        };
    }
    bytes
}

/// Refuse XML that would take more than `memory_bytes` once parsed, or a parser more time than in proportion to its length. Every reader
/// calls this first; other faults are left to the parser.
///
/// # Errors
/// [`XmlFault`].
pub fn check(xml: &str, memory_bytes: u64) -> Result<(), XmlFault> {
    let needed_bytes = parsed_bytes(xml);
    if needed_bytes > memory_bytes {
        return Err(XmlFault::Memory {
            needed_bytes,
            allowed_bytes: memory_bytes,
        });
    }
    check_plain(xml).map_err(XmlFault::Damaged)
}

/// Refuse elements with very many attributes, and very many namespaces: the parser compares each with all others.
fn check_plain(xml: &str) -> Result<(), String> {
    let bytes = xml.as_bytes();
    let too_many = |byte: usize, what: &str| {
        Err(format!(
            "byte {byte}: more than {MAX_ATTRIBUTES} {what}; no file has so many: it is damaged"
        ))
    };
    if let Some((byte, _)) = xml.match_indices("xmlns").nth(MAX_ATTRIBUTES) {
        return too_many(byte, "declarations of namespaces");
    }
    let mut at = 0;
    while let Some(start) = bytes[at..].iter().position(|&b| b == b'<') {
        let start = at + start;
        let passed_over = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((_, end)) = passed_over
            .iter()
            .find(|(begin, _)| bytes[start..].starts_with(begin.as_bytes()))
        {
            match xml[start..].find(end) {
                Some(length) => at = start + length + end.len(),
                None => return Ok(()),
            }
            continue;
        }
        let (mut attributes, mut quote) = (0, None);
        at = start + 1;
        while let Some(&byte) = bytes.get(at) {
            match quote {
                // Nowhere in a tag: whatever this is, the parser will say.
                _ if byte == b'<' => break,
                Some(mark) if byte == mark => quote = None,
                Some(_) => {}
                None => match byte {
                    b'"' | b'\'' => quote = Some(byte),
                    b'=' => attributes += 1,
                    b'>' => break,
                    _ => {}
                },
            }
            at += 1;
        }
        if attributes > MAX_ATTRIBUTES {
            return too_many(start, "attributes of one element");
        }
    }
    Ok(())
}
