//! XML elements that know their own path, so that every error can name it; and a writer of elements.

use std::borrow::Cow;

use glam::DVec3;
use roxmltree::Node;

/// What is wrong with the XML of a CPHD file, and in which element.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("XML: {0}")]
pub struct MetadataError(pub(super) String);

/// Attributes that an element may have, and declarations of namespaces a document: the standard's have two of
/// each at most. A parser compares every one with every other.
const MOST_ATTRIBUTES: usize = 100;

/// Refuses text that takes a parser more time than in proportion to its length: elements of very many
/// attributes, and very many namespaces. What else may be wrong with it is left to the parser.
pub(super) fn check_plain(xml: &str) -> Result<(), MetadataError> {
    let bytes = xml.as_bytes();
    let too_many = |byte: usize, what: &str| {
        Err(MetadataError(format!(
            "byte {byte}: more than {MOST_ATTRIBUTES} {what}; no CPHD file has so many: it is damaged"
        )))
    };
    if let Some((byte, _)) = xml.match_indices("xmlns").nth(MOST_ATTRIBUTES) {
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
        if attributes > MOST_ATTRIBUTES {
            return too_many(start, "attributes of one element");
        }
    }
    Ok(())
}

/// An element and its path from the root, such as `CPHD/Global/SGN`.
pub(super) struct Element<'a, 'i> {
    node: Node<'a, 'i>,
    path: String,
}

impl<'a, 'i> Element<'a, 'i> {
    pub(super) fn root(node: Node<'a, 'i>) -> Self {
        Self {
            path: node.tag_name().name().to_owned(),
            node,
        }
    }

    pub(super) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    pub(super) fn namespace(&self) -> &'a str {
        self.node.tag_name().namespace().unwrap_or_default()
    }

    /// An error about this element.
    pub(super) fn fault(&self, what: impl std::fmt::Display) -> MetadataError {
        MetadataError(format!("{}: {what}", self.path))
    }

    /// Children of this name, whatever their namespace.
    pub(super) fn children(&self, name: &'static str) -> impl Iterator<Item = Self> + use<'a, 'i> {
        let path = format!("{}/{name}", self.path);
        self.node
            .children()
            .filter(move |n| n.is_element() && n.tag_name().name() == name)
            .map(move |node| Self {
                node,
                path: path.clone(),
            })
    }

    pub(super) fn optional(&self, name: &'static str) -> Option<Self> {
        self.children(name).next()
    }

    pub(super) fn child(&self, name: &'static str) -> Result<Self, MetadataError> {
        self.optional(name)
            .ok_or_else(|| self.fault(format!("no element {name}; the standard requires it")))
    }

    /// The text, without white space around it. Comments and processing instructions are no part of
    /// it, so it may come in several pieces.
    pub(super) fn text(&self) -> Cow<'a, str> {
        let mut pieces = self.node.children().filter(Node::is_text);
        let first = pieces.next().and_then(|n| n.text()).unwrap_or_default();
        let rest: String = pieces.filter_map(|n| n.text()).collect();
        if rest.is_empty() {
            return Cow::Borrowed(first.trim());
        }
        Cow::Owned(format!("{first}{rest}").trim().to_owned())
    }

    pub(super) fn optional_text(&self, name: &'static str) -> Option<String> {
        self.optional(name).map(|e| e.text().into_owned())
    }

    /// The text of an element that holds no other elements.
    fn only_text(&self) -> Result<Cow<'a, str>, MetadataError> {
        if self.node.children().any(|n| n.is_element()) {
            return Err(self.fault("holds more than a number"));
        }
        Ok(self.text())
    }

    pub(super) fn number(&self) -> Result<f64, MetadataError> {
        let text = self.only_text()?;
        text.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| self.fault(format!("'{text}' is not a finite number")))
    }

    pub(super) fn count(&self) -> Result<u64, MetadataError> {
        let text = self.only_text()?;
        text.parse()
            .map_err(|_| self.fault(format!("'{text}' is not a count from 0 to 2^64 - 1")))
    }

    pub(super) fn xyz(&self) -> Result<DVec3, MetadataError> {
        Ok(DVec3::new(
            self.child("X")?.number()?,
            self.child("Y")?.number()?,
            self.child("Z")?.number()?,
        ))
    }

    pub(super) fn pair(
        &self,
        first: &'static str,
        second: &'static str,
    ) -> Result<(f64, f64), MetadataError> {
        Ok((self.child(first)?.number()?, self.child(second)?.number()?))
    }
}

/// Writes indented elements.
pub(super) struct Writer {
    text: String,
    depth: usize,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self {
            text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned(),
            depth: 0,
        }
    }

    pub(super) fn finish(self) -> String {
        self.text
    }

    /// An element with children. `attributes` are plain ASCII of our own making.
    pub(super) fn element(
        &mut self,
        name: &str,
        attributes: &str,
        content: impl FnOnce(&mut Self),
    ) {
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
    pub(super) fn text(&mut self, name: &str, value: impl std::fmt::Display) {
        self.text_with(name, "", value);
    }

    pub(super) fn text_with(
        &mut self,
        name: &str,
        attributes: &str,
        value: impl std::fmt::Display,
    ) {
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
    pub(super) fn number(&mut self, name: &str, value: f64) {
        self.text(name, format_args!("{value:?}"));
    }

    pub(super) fn numbers(&mut self, values: &[(&str, f64)]) {
        for (name, value) in values {
            self.number(name, *value);
        }
    }

    pub(super) fn xyz(&mut self, name: &str, v: DVec3) {
        self.element(name, "", |w| {
            w.numbers(&[("X", v.x), ("Y", v.y), ("Z", v.z)]);
        });
    }

    fn indent(&mut self) {
        self.text.extend(std::iter::repeat_n("  ", self.depth));
    }
}
