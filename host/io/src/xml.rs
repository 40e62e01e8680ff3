//! Writer of XML elements, indented and escaped; checks of XML before it is parsed ([`check`]).

use glam::DVec3;
use subaperture_model::quantity::bytes;

/// Writer of indented elements.
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
    /// Create a document that begins with its declaration.
    pub fn new() -> Self {
        Self {
            text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned(),
            depth: 0,
        }
    }

    /// Return the text of the document.
    pub fn finish(self) -> String {
        self.text
    }

    /// Write an element with children. `attributes` must be plain ASCII.
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

    /// Write an element with text, which is escaped.
    pub fn text(&mut self, name: &str, value: impl std::fmt::Display) {
        self.text_with(name, "", value);
    }

    /// Write an element with attributes and text, which is escaped.
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

    /// Write an element with a number, in the fewest digits that read back to the same float64.
    pub fn number(&mut self, name: &str, value: f64) {
        self.text(name, format_args!("{value:?}"));
    }

    /// Write elements with a number each.
    pub fn numbers(&mut self, values: &[(&str, f64)]) {
        for (name, value) in values {
            self.number(name, *value);
        }
    }

    /// Write an element with the children `X`, `Y` and `Z`.
    pub fn xyz(&mut self, name: &str, v: DVec3) {
        self.element(name, "", |w| {
            w.numbers(&[("X", v.x), ("Y", v.y), ("Z", v.z)]);
        });
    }

    fn indent(&mut self) {
        self.text.extend(std::iter::repeat_n("  ", self.depth));
    }
}

/// Maximum number of attributes of an element, and of namespace declarations of a document. The standards use at most
/// two of each; a parser compares every one with every other.
const MAX_ATTRIBUTES: usize = 100;

/// Default limit on the memory of parsed XML in bytes.
pub const DEFAULT_MEMORY_BYTES: u64 = 1 << 30;

/// Memory per opening bracket in bytes: an element and a text of the parser's tree in a list that grows by doubling,
/// and the reader's data for an element.
const NODE_BYTES: u64 = 200;
/// Memory per equals sign in bytes: an attribute.
const ATTRIBUTE_BYTES: u64 = 100;
/// Memory per ampersand in bytes, in addition to its text: an allocated string.
const ESCAPE_BYTES: u64 = 64;
/// Copies of a byte of text: the text, the unescaped text, and the reader's copy.
const COPIES: u64 = 3;

/// Reason why XML is not parsed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum XmlFault {
    /// Parsing would take very long, or the text is damaged.
    #[error("{0}")]
    Damaged(String),
    /// Parsing would need too much memory.
    #[error(
        "expected XML that takes at most {} of memory, found one that would need {}: allow more memory, or use a file of fewer channels",
        bytes((*allowed_bytes).into()), bytes((*needed_bytes).into())
    )]
    Memory {
        /// Memory needed by the parsed text in bytes.
        needed_bytes: u64,
        /// Memory limit of the caller in bytes.
        allowed_bytes: u64,
    },
}

/// Upper bound on the memory of parsed XML in bytes, from the number of its brackets, equals signs and ampersands.
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

/// Refuse XML that would take more than `memory_bytes` when parsed, or more time than in proportion to its length.
/// Every reader calls this first; the parser detects other faults.
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

/// Refuse elements with very many attributes, and very many namespaces, since the parser compares each with all
/// others.
fn check_plain(xml: &str) -> Result<(), String> {
    let bytes = xml.as_bytes();
    let too_many = |byte: usize, what: &str| {
        Err(format!(
            "byte {byte}: expected at most {MAX_ATTRIBUTES} {what}, found more: the file is damaged"
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
                // Not inside a tag: the parser reports the fault.
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
