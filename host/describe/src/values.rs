//! Values of a section, checked against the schema, for builders.

use std::cell::Cell;
use std::collections::BTreeMap;

use glam::DVec3;

use super::declare::{KeyType, split};
use super::error::{Fault, Location};
use super::schema::Section;

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
    /// Whether a builder has read it.
    pub taken: Cell<bool>,
}

/// Section of a description with defaults filled in. All required keys are present.
#[derive(Clone, Debug)]
pub struct Values {
    /// Schema of the section.
    pub section: &'static Section,
    /// Position of the section's header.
    pub at: Location,
    /// Values by key.
    pub keys: BTreeMap<&'static str, LocatedValue>,
    /// Subsections by name; several under one name for an array of tables.
    pub within: BTreeMap<&'static str, Vec<Values>>,
}

/// # Panics
/// All methods that take a key: if the schema has no key of this name and type. Methods whose name does not begin with
/// `optional`: if the key is neither required nor has a default. Both are programming errors, which occur on every use.
impl Values {
    fn given(&self, key: &str) -> Option<&LocatedValue> {
        assert!(
            self.section.key(key).is_some(),
            "no key '{key}' of {} in the schema",
            self.section.header()
        );
        let given = self.keys.get(key)?;
        given.taken.set(true);
        Some(given)
    }

    fn value(&self, key: &str) -> &Value {
        let given = self.given(key);
        &given
            .unwrap_or_else(|| panic!("{}: '{key}' may be absent", self.section.header()))
            .value
    }

    /// Value of the key of a field, whose name may end in a unit.
    pub fn key<T: KeyType>(&self, field: &'static str) -> T {
        let (name, _) = split(field);
        T::read(self.given(name), &self.at)
    }

    /// Position of a key's value; that of the section if the key is absent.
    pub fn at(&self, key: &str) -> &Location {
        self.keys.get(key).map_or(&self.at, |given| &given.at)
    }

    /// Make a fault at a key's value.
    pub fn fault(&self, key: &str, message: impl Into<String>) -> Fault {
        Fault::new(self.at(key), message)
    }

    /// Whether the key is given in the text or by a setting, instead of left to its default.
    pub fn says(&self, key: &str) -> bool {
        self.keys.get(key).is_some_and(|given| given.at != self.at)
    }

    /// Quantity of a key, SI units; `None` if not given.
    pub fn optional_number(&self, key: &str) -> Option<f64> {
        match &self.given(key)?.value {
            Value::Number(number) => Some(*number),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Quantity of a key, SI units.
    pub fn number(&self, key: &str) -> f64 {
        match self.value(key) {
            Value::Number(number) => *number,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// String of a key; `None` if not given.
    pub fn optional_text(&self, key: &str) -> Option<&str> {
        match &self.given(key)?.value {
            Value::Text(text) => Some(text),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// String of a key.
    pub fn text(&self, key: &str) -> &str {
        match self.value(key) {
            Value::Text(text) => text,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Strings of a key, one or more.
    pub fn texts(&self, key: &str) -> &[String] {
        match self.value(key) {
            Value::Texts(texts) => texts,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Strings of a key, one or more; `None` if not given.
    pub fn optional_texts(&self, key: &str) -> Option<&[String]> {
        self.given(key).map(|_| self.texts(key))
    }

    /// Boolean of a key.
    pub fn flag(&self, key: &str) -> bool {
        matches!(self.value(key), Value::Flag(true))
    }

    /// Integer of a key.
    pub fn count(&self, key: &str) -> u64 {
        match self.value(key) {
            Value::Count(count) => *count,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Integer of a key; `None` if not given.
    pub fn optional_count(&self, key: &str) -> Option<u64> {
        self.given(key).map(|_| self.count(key))
    }

    /// Lower and upper limits of a key, SI units.
    pub fn interval(&self, key: &str) -> (f64, f64) {
        match self.value(key) {
            Value::Numbers(numbers) => (numbers[0], numbers[1]),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Vector of a key, SI units.
    pub fn vector(&self, key: &str) -> DVec3 {
        match self.value(key) {
            Value::Numbers(numbers) => DVec3::from_slice(numbers),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Vector of a key, SI units; `None` if not given.
    pub fn optional_vector(&self, key: &str) -> Option<DVec3> {
        self.given(key).map(|_| self.vector(key))
    }

    /// Unit vector along a key's vector. The error is that of a zero vector.
    pub fn direction(&self, key: &str) -> Result<DVec3, Fault> {
        self.vector(key).try_normalize().ok_or_else(|| {
            self.fault(
                key,
                "a direction cannot have length zero: write for example \"0, 1, 0\"",
            )
        })
    }

    /// Lower and upper limits of a key, SI units; `None` if not given.
    pub fn optional_interval(&self, key: &str) -> Option<(f64, f64)> {
        self.given(key).map(|_| self.interval(key))
    }

    /// Rows of a key, SI units.
    pub fn rows(&self, key: &str) -> &[Vec<f64>] {
        match self.value(key) {
            Value::Rows(rows) => rows,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// Rows of a key, SI units; `None` if not given.
    pub fn optional_rows(&self, key: &str) -> Option<&[Vec<f64>]> {
        self.given(key).map(|_| self.rows(key))
    }

    /// Subsections called `name`; empty if there are none.
    pub fn sections(&self, name: &str) -> &[Self] {
        self.within.get(name).map_or(&[], Vec::as_slice)
    }

    /// First subsection called `name`; `None` if there is none.
    pub fn optional_section(&self, name: &str) -> Option<&Self> {
        self.sections(name).first()
    }

    /// Subsection called `name`, which must always be present.
    pub fn section(&self, name: &str) -> &Self {
        let section = self.optional_section(name);
        section.unwrap_or_else(|| panic!("section '{name}' may be absent"))
    }

    /// Keys that no builder has read, with their sections: a programming error.
    pub fn not_taken(&self) -> Vec<String> {
        let own = self.keys.iter().filter(|(_, given)| !given.taken.get());
        let own = own.map(|(key, _)| format!("{} {key}", self.section.header()));
        let within = self.within.values().flatten().flat_map(Self::not_taken);
        own.chain(within).collect()
    }
}
