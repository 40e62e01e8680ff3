//! XML elements whose errors state the path from the root.

use std::borrow::Cow;

use glam::DVec3;
use roxmltree::{Document, Node};

use crate::xml::check;

/// Fault in the XML of a file, with the path of its element.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("XML: {0}")]
pub struct MetadataError(pub(crate) String);

/// Parse XML that takes at most `memory_bytes` once parsed.
///
/// # Errors
/// [`MetadataError`] if it is not well formed or would take more.
pub fn parse(xml: &str, memory_bytes: u64) -> Result<Document<'_>, MetadataError> {
    check(xml, memory_bytes).map_err(|fault| MetadataError(fault.to_string()))?;
    Document::parse(xml)
        .map_err(|e| MetadataError(format!("not well formed: {e}; copy the file again")))
}

/// XML element with attributes and children.
#[derive(Clone, Copy, Debug)]
pub struct Element<'a, 'i>(Node<'a, 'i>);

impl<'a, 'i> Element<'a, 'i> {
    /// Root element of a document.
    pub fn root(document: &'a Document<'i>) -> Self {
        Self(document.root_element())
    }

    /// Name without namespace.
    pub fn name(self) -> &'a str {
        self.0.tag_name().name()
    }

    /// Namespace.
    pub fn namespace(self) -> &'a str {
        self.0.tag_name().namespace().unwrap_or_default()
    }

    /// Error about this element.
    pub fn fault(self, what: impl std::fmt::Display) -> MetadataError {
        let path = self.0.ancestors().filter(Node::is_element);
        let mut path: Vec<&str> = path.map(|node| node.tag_name().name()).collect();
        path.reverse();
        MetadataError(format!("{}: {what}", path.join("/")))
    }

    /// Child elements of this name, whatever their namespace.
    pub fn children<'n>(self, name: &'n str) -> impl Iterator<Item = Self> + use<'a, 'i, 'n> {
        let own = move |n: &Node| n.is_element() && n.tag_name().name() == name;
        self.0.children().filter(own).map(Self)
    }

    /// All child elements, in document order.
    pub fn elements(self) -> impl Iterator<Item = Self> {
        self.0.children().filter(Node::is_element).map(Self)
    }

    /// This element and all below it.
    pub fn descendants(self) -> impl Iterator<Item = Self> {
        self.0.descendants().filter(Node::is_element).map(Self)
    }

    /// First child of this name.
    pub fn optional(self, name: &str) -> Option<Self> {
        self.children(name).next()
    }

    /// First child of this name.
    ///
    /// # Errors
    /// [`MetadataError`] if the element is missing.
    pub fn child(self, name: &str) -> Result<Self, MetadataError> {
        self.optional(name).ok_or_else(|| self.missing(name))
    }

    /// Element at a path of names below this one.
    pub fn find(self, path: &[&str]) -> Option<Self> {
        path.iter().try_fold(self, |at, name| at.optional(name))
    }

    /// Element at a path of names below this one.
    ///
    /// # Errors
    /// [`MetadataError`] if there is none.
    pub fn at(self, path: &[&str]) -> Result<Self, MetadataError> {
        self.find(path).ok_or_else(|| self.missing(&path.join("/")))
    }

    fn missing(self, path: &str) -> MetadataError {
        self.fault(format!("no element {path}; the standard requires it"))
    }

    /// Value of an attribute.
    pub fn attribute(self, name: &str) -> Option<&'a str> {
        self.0.attribute(name)
    }

    /// Text without surrounding white space, comments and processing instructions.
    pub fn text(self) -> Cow<'a, str> {
        let mut pieces = self.0.children().filter(Node::is_text);
        let first = pieces.next().and_then(|n| n.text()).unwrap_or_default();
        let rest: String = pieces.filter_map(|n| n.text()).collect();
        if rest.is_empty() {
            return Cow::Borrowed(first.trim());
        }
        Cow::Owned(format!("{first}{rest}").trim().to_owned())
    }

    /// Text of the first child of this name.
    pub fn optional_text(self, name: &str) -> Option<String> {
        self.optional(name).map(|e| e.text().into_owned())
    }

    /// Text of an element without child elements.
    fn only_text(self) -> Result<Cow<'a, str>, MetadataError> {
        match self.elements().next() {
            Some(_) => Err(self.fault("expected a number, found child elements")),
            None => Ok(self.text()),
        }
    }

    /// Finite number.
    ///
    /// # Errors
    /// [`MetadataError`] if the text is not one.
    pub fn number(self) -> Result<f64, MetadataError> {
        let text = self.only_text()?;
        text.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| self.fault(format!("expected a finite number, found '{text}'")))
    }

    /// Number from 0 to 2^64 - 1.
    ///
    /// # Errors
    /// [`MetadataError`] if the text is not one.
    pub fn count(self) -> Result<u64, MetadataError> {
        let text = self.only_text()?;
        text.parse().map_err(|_| {
            self.fault(format!(
                "expected an integer from 0 to 2^64 - 1, found '{text}'"
            ))
        })
    }

    /// Vector of the children `X`, `Y` and `Z`.
    ///
    /// # Errors
    /// [`MetadataError`] if one is missing or not a finite number.
    pub fn xyz(self) -> Result<DVec3, MetadataError> {
        Ok(DVec3::new(
            self.child("X")?.number()?,
            self.child("Y")?.number()?,
            self.child("Z")?.number()?,
        ))
    }

    /// Numbers of two children.
    ///
    /// # Errors
    /// [`MetadataError`] if one is missing or not a finite number.
    pub fn pair(self, first: &str, second: &str) -> Result<(f64, f64), MetadataError> {
        Ok((self.child(first)?.number()?, self.child(second)?.number()?))
    }
}
