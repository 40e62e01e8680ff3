//! Values of a section, checked against the schema.

use std::collections::BTreeMap;

use super::error::{Fault, Location};

/// Value in SI units.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// String.
    Text(String),
    /// Strings.
    Texts(Vec<String>),
    /// Boolean.
    Flag(bool),
    /// Integer.
    Count(u64),
    /// Quantity.
    Number(f64),
    /// Vector or interval.
    Numbers(Vec<f64>),
    /// Rows of quantities.
    Rows(Vec<Vec<f64>>),
}

impl Value {
    /// The string, if it is one.
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }
}

/// Value of a key with its position.
#[derive(Clone, Debug)]
pub struct LocatedValue {
    /// Parsed value, SI units.
    pub value: Value,
    /// Position in the text, or of the setting.
    pub at: Location,
}

/// Section of a description with defaults filled in. All required keys are present.
#[derive(Clone, Debug)]
pub struct Values {
    /// Position of the section's header.
    pub at: Location,
    /// Values by the name of their key.
    pub keys: BTreeMap<&'static str, LocatedValue>,
    /// Subsections by name; several under one name for an array of tables.
    pub within: BTreeMap<String, Vec<Values>>,
}

impl Values {
    /// Position of a key's value; that of the section if the key is absent.
    pub fn at(&self, key: &str) -> &Location {
        self.keys.get(key).map_or(&self.at, |given| &given.at)
    }

    /// Make a fault at a key's value.
    pub fn fault(&self, key: &str, message: impl Into<String>) -> Fault {
        Fault::new(self.at(key), message)
    }

    /// Subsections called `name`, in the order of the text.
    pub fn sections(&self, name: &str) -> &[Self] {
        self.within.get(name).map_or(&[], Vec::as_slice)
    }

    /// First subsection called `name`; `None` if there is none.
    pub fn optional_section(&self, name: &str) -> Option<&Self> {
        self.sections(name).first()
    }

    /// Subsection called `name`.
    ///
    /// # Panics
    /// If the section may be absent.
    pub fn section(&self, name: &str) -> &Self {
        let section = self.optional_section(name);
        section.unwrap_or_else(|| panic!("section '{name}' may be absent"))
    }
}
