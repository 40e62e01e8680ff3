//! A section's values, checked against the table of keys, for the builders to take.

use std::cell::Cell;
use std::collections::BTreeMap;

use glam::DVec3;

use super::error::{At, Found};
use super::schema::Section;

/// A value in SI units.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A text.
    Text(String),
    /// Texts.
    Texts(Vec<String>),
    /// True or false.
    Flag(bool),
    /// A whole number.
    Count(u64),
    /// A quantity.
    Number(f64),
    /// Vectors and intervals.
    Numbers(Vec<f64>),
    /// Rows of quantities.
    Rows(Vec<Vec<f64>>),
}

/// A value, where it is, and whether a builder has asked for it.
#[derive(Clone, Debug)]
pub struct Given {
    /// It itself.
    pub value: Value,
    /// Where the text, or a setting, has it.
    pub at: At,
    /// Whether a builder has asked for it.
    pub taken: Cell<bool>,
}

/// A section of a description with defaults filled in. All keys that are required are there.
#[derive(Clone, Debug)]
pub struct Values {
    /// What it may say.
    pub section: &'static Section,
    /// Its header.
    pub at: At,
    /// Its values, by key.
    pub keys: BTreeMap<&'static str, Given>,
    /// Sections within, by name.
    pub within: BTreeMap<&'static str, Vec<Values>>,
}

/// # Panics
/// All methods that take a key: if the table of keys has none of this name and kind. Those whose name
/// does not begin with `optional`: if it is neither required nor has a default. Both are faults of the
/// program that every use shows.
impl Values {
    fn given(&self, key: &str) -> Option<&Given> {
        assert!(
            self.section.key(key).is_some(),
            "no key '{key}' of {} in the table",
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

    /// Where the key's value is, or else the section.
    pub fn at(&self, key: &str) -> &At {
        self.keys.get(key).map_or(&self.at, |given| &given.at)
    }

    /// Something wrong with a key's value.
    pub fn fault(&self, key: &str, message: impl Into<String>) -> Found {
        Found::new(self.at(key), message)
    }

    /// Whether the text, or a setting, says the key, which is not left to its default.
    pub fn says(&self, key: &str) -> bool {
        self.keys.get(key).is_some_and(|given| given.at != self.at)
    }

    /// The quantity of a key, SI, if it is given.
    pub fn optional_number(&self, key: &str) -> Option<f64> {
        match &self.given(key)?.value {
            Value::Number(number) => Some(*number),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The quantity of a key, SI.
    pub fn number(&self, key: &str) -> f64 {
        match self.value(key) {
            Value::Number(number) => *number,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The text of a key, if it is given.
    pub fn optional_text(&self, key: &str) -> Option<&str> {
        match &self.given(key)?.value {
            Value::Text(text) => Some(text),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The text of a key.
    pub fn text(&self, key: &str) -> &str {
        match self.value(key) {
            Value::Text(text) => text,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// All texts of an array, or the one.
    pub fn texts(&self, key: &str) -> &[String] {
        match self.value(key) {
            Value::Texts(texts) => texts,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// All texts of an array, or the one, if it is given.
    pub fn optional_texts(&self, key: &str) -> Option<&[String]> {
        self.given(key).map(|_| self.texts(key))
    }

    /// Whether a key says true.
    pub fn flag(&self, key: &str) -> bool {
        matches!(self.value(key), Value::Flag(true))
    }

    /// The whole number of a key.
    pub fn count(&self, key: &str) -> u64 {
        match self.value(key) {
            Value::Count(count) => *count,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The whole number of a key, if it is given.
    pub fn optional_count(&self, key: &str) -> Option<u64> {
        self.given(key).map(|_| self.count(key))
    }

    /// From and to of a key, SI.
    pub fn interval(&self, key: &str) -> (f64, f64) {
        match self.value(key) {
            Value::Numbers(numbers) => (numbers[0], numbers[1]),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The vector of a key, SI.
    pub fn vector(&self, key: &str) -> DVec3 {
        match self.value(key) {
            Value::Numbers(numbers) => DVec3::from_slice(numbers),
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The vector of a key, SI, if it is given.
    pub fn optional_vector(&self, key: &str) -> Option<DVec3> {
        self.given(key).map(|_| self.vector(key))
    }

    /// The direction of a vector, which must have one.
    pub fn direction(&self, key: &str) -> Result<DVec3, Found> {
        self.vector(key).try_normalize().ok_or_else(|| {
            self.fault(
                key,
                "a direction of length zero points nowhere: write for example \"0, 1, 0\"",
            )
        })
    }

    /// From and to of a key, SI, if it is given.
    pub fn optional_interval(&self, key: &str) -> Option<(f64, f64)> {
        self.given(key).map(|_| self.interval(key))
    }

    /// The rows of a key, SI.
    pub fn rows(&self, key: &str) -> &[Vec<f64>] {
        match self.value(key) {
            Value::Rows(rows) => rows,
            other => unreachable!("'{key}' is {other:?}"),
        }
    }

    /// The rows of a key, SI, if it is given.
    pub fn optional_rows(&self, key: &str) -> Option<&[Vec<f64>]> {
        self.given(key).map(|_| self.rows(key))
    }

    /// The sections of this name within; none if there are none.
    pub fn sections(&self, name: &str) -> &[Self] {
        self.within.get(name).map_or(&[], Vec::as_slice)
    }

    /// The one section of this name within.
    pub fn optional_section(&self, name: &str) -> Option<&Self> {
        self.sections(name).first()
    }

    /// The one section of this name within, which is always there.
    pub fn section(&self, name: &str) -> &Self {
        let section = self.optional_section(name);
        section.unwrap_or_else(|| panic!("section '{name}' may be absent"))
    }

    /// Keys that no builder has asked for, with their sections' paths: a fault of the program.
    pub fn not_taken(&self) -> Vec<String> {
        let own = self.keys.iter().filter(|(_, given)| !given.taken.get());
        let own = own.map(|(key, _)| format!("{} {key}", self.section.header()));
        let within = self.within.values().flatten().flat_map(Self::not_taken);
        own.chain(within).collect()
    }
}
