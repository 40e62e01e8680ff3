//! XML elements that know their own path, so that every error can name it.

use std::borrow::Cow;

use glam::DVec3;
use roxmltree::Node;

/// Fault in the XML of a CPHD or CRSD file, with its element.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("XML: {0}")]
pub struct MetadataError(pub(crate) String);

/// An element and its path from the root, such as `CPHD/Global/SGN`.
pub(crate) struct Element<'a, 'i> {
    node: Node<'a, 'i>,
    path: String,
}

impl<'a, 'i> Element<'a, 'i> {
    pub(crate) fn root(node: Node<'a, 'i>) -> Self {
        Self {
            path: node.tag_name().name().to_owned(),
            node,
        }
    }

    pub(crate) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    pub(crate) fn namespace(&self) -> &'a str {
        self.node.tag_name().namespace().unwrap_or_default()
    }

    /// An error about this element.
    pub(crate) fn fault(&self, what: impl std::fmt::Display) -> MetadataError {
        MetadataError(format!("{}: {what}", self.path))
    }

    /// Children of this name, whatever their namespace.
    pub(crate) fn children(&self, name: &'static str) -> impl Iterator<Item = Self> + use<'a, 'i> {
        let path = format!("{}/{name}", self.path);
        self.node
            .children()
            .filter(move |n| n.is_element() && n.tag_name().name() == name)
            .map(move |node| Self {
                node,
                path: path.clone(),
            })
    }

    pub(crate) fn optional(&self, name: &'static str) -> Option<Self> {
        self.children(name).next()
    }

    pub(crate) fn child(&self, name: &'static str) -> Result<Self, MetadataError> {
        self.optional(name)
            .ok_or_else(|| self.fault(format!("no element {name}; the standard requires it")))
    }

    pub(crate) fn attribute(&self, name: &str) -> Option<&'a str> {
        self.node.attribute(name)
    }

    /// The text, without white space around it. Comments and processing instructions are no part of
    /// it, so it may come in several pieces.
    pub(crate) fn text(&self) -> Cow<'a, str> {
        let mut pieces = self.node.children().filter(Node::is_text);
        let first = pieces.next().and_then(|n| n.text()).unwrap_or_default();
        let rest: String = pieces.filter_map(|n| n.text()).collect();
        if rest.is_empty() {
            return Cow::Borrowed(first.trim());
        }
        Cow::Owned(format!("{first}{rest}").trim().to_owned())
    }

    pub(crate) fn optional_text(&self, name: &'static str) -> Option<String> {
        self.optional(name).map(|e| e.text().into_owned())
    }

    /// The text of an element that holds no other elements.
    fn only_text(&self) -> Result<Cow<'a, str>, MetadataError> {
        if self.node.children().any(|n| n.is_element()) {
            return Err(self.fault("holds more than a number"));
        }
        Ok(self.text())
    }

    pub(crate) fn number(&self) -> Result<f64, MetadataError> {
        let text = self.only_text()?;
        text.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| self.fault(format!("'{text}' is not a finite number")))
    }

    pub(crate) fn count(&self) -> Result<u64, MetadataError> {
        let text = self.only_text()?;
        text.parse()
            .map_err(|_| self.fault(format!("'{text}' is not a count from 0 to 2^64 - 1")))
    }

    pub(crate) fn xyz(&self) -> Result<DVec3, MetadataError> {
        Ok(DVec3::new(
            self.child("X")?.number()?,
            self.child("Y")?.number()?,
            self.child("Z")?.number()?,
        ))
    }

    pub(crate) fn pair(
        &self,
        first: &'static str,
        second: &'static str,
    ) -> Result<(f64, f64), MetadataError> {
        Ok((self.child(first)?.number()?, self.child(second)?.number()?))
    }
}
