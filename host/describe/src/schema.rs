//! Schema of a description: sections and keys.

use subaperture_model::units::{Dimension, example_row};

/// Schema of one kind of description.
#[derive(Debug)]
pub struct Schema {
    /// All sections; the top level is the first, and subsections follow their parents.
    pub sections: Vec<Section>,
    /// Introduction of the key reference.
    pub introduction: &'static str,
}

/// Table or array of tables in the text.
#[derive(Debug)]
pub struct Section {
    /// Dotted path; empty for the top level.
    pub path: String,
    /// How often the section may occur.
    pub presence: Presence,
    /// Values of the parent's selector for which the section applies; empty for all.
    pub when: &'static [&'static str],
    /// Name of the key whose value selects the applicable keys; empty if there is none.
    pub selector: &'static str,
    /// Description, shown in the key reference.
    pub doc: &'static str,
    /// Keys of the section.
    pub keys: Vec<Key>,
}

/// Number of occurrences of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Once. May be omitted if none of its keys is required: all keys then have their defaults.
    Always,
    /// At most once.
    Optional,
    /// Any number of times.
    Many,
}

/// Key of a section.
#[derive(Debug)]
pub struct Key {
    /// Name in the text.
    pub name: &'static str,
    /// Type of the value.
    pub kind: ValueType,
    /// Whether the key is required, with its default or an example.
    pub need: Requirement,
    /// Values of the section's selector for which the key applies; empty for all.
    pub when: &'static [&'static str],
    /// Description, shown in the key reference.
    pub doc: &'static str,
}

/// Type of a value.
#[derive(Clone, Copy, Debug)]
pub enum ValueType {
    /// Any text.
    Text,
    /// Path, relative to the description's folder.
    Path,
    /// Path or array of paths, relative to the description's folder. `{01..64}` expands to these numbers in sequence.
    Paths,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// One of these words, or an array of them.
    Choices(&'static [&'static str]),
    /// `true` or `false`.
    Flag,
    /// Integer within these bounds, both included.
    Count(u64, u64),
    /// Quantity with a dimension and bounds.
    Quantity(Dimension, Bounds),
    /// Three quantities: x, y and z.
    Vector(Dimension),
    /// Two quantities, the second one larger.
    Interval(Dimension),
    /// Array of texts, each a row of quantities; with a minimum number of rows.
    Rows(&'static [Dimension], usize),
}

/// Bounds of a quantity, in SI units.
#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    /// Any finite number.
    Any,
    /// Above zero.
    Positive,
    /// Zero or more.
    NotNegative,
    /// From and to, both included, and the same as text.
    Within(f64, f64, &'static str),
}

/// Whether a key is required. The text is TOML.
#[derive(Clone, Copy, Debug)]
pub enum Requirement {
    /// Required; with an example.
    Required(&'static str),
    /// Optional, with this default.
    Default(&'static str),
    /// Optional, without a default; with an example.
    Optional(&'static str),
}

/// Smallest positive value: below all times, lengths and frequencies in use, and far from where float64 loses digits.
const SMALLEST: f64 = 1e-18;

impl Bounds {
    /// The expected value, if `value` is out of bounds; `None` if it is within.
    pub fn refuse(self, value: f64) -> Option<String> {
        match self {
            Self::Any => None,
            Self::Positive => (value < SMALLEST).then(|| "above 0".to_owned()),
            Self::NotNegative => (value < 0.0).then(|| "0 or more".to_owned()),
            Self::Within(from, to, words) => {
                (!(from..=to).contains(&value)).then(|| format!("from {words}"))
            }
        }
    }

    fn words(self) -> String {
        match self {
            Self::Any => String::new(),
            Self::Positive => ", above 0".to_owned(),
            Self::NotNegative => ", 0 or more".to_owned(),
            Self::Within(_, _, words) => format!(", {words}"),
        }
    }
}

impl ValueType {
    /// Description of the type, for the key reference and errors.
    pub fn words(self) -> String {
        match self {
            Self::Text => "text".to_owned(),
            Self::Path => "path, relative to the folder of this file".to_owned(),
            Self::Paths => "path or array of paths, relative to the folder of this file; {01..64} expands to these \
                                       numbers in sequence"
                .to_owned(),
            Self::Choice(words) => words
                .iter()
                .map(|word| format!("\"{word}\""))
                .collect::<Vec<_>>()
                .join(", "),
            Self::Choices(words) => format!("one or an array of {}", Self::Choice(words).words()),
            Self::Flag => "true or false".to_owned(),
            Self::Count(from, u64::MAX) => format!("whole number, {from} or more"),
            Self::Count(from, to) => format!("whole number, {from} to {to}"),
            Self::Quantity(dimension, bounds) => match dimension {
                Dimension::Ratio => format!("number, also in %, ppm or ppb{}", bounds.words()),
                _ => format!(
                    "{} ({}){}",
                    bare(dimension),
                    dimension.units(),
                    bounds.words()
                ),
            },
            Self::Vector(Dimension::Ratio) => "direction: three numbers x, y, z".to_owned(),
            Self::Vector(dimension) => {
                format!("x, y, z, each {} ({})", dimension.name(), dimension.units())
            }
            Self::Interval(dimension) => {
                format!(
                    "from, to, each {} ({})",
                    dimension.name(),
                    dimension.units()
                )
            }
            Self::Rows(dimensions, least) => {
                format!(
                    "array of {least} or more texts, such as {}",
                    example_row(dimensions)
                )
            }
        }
    }
}

/// Name of a dimension without its article.
fn bare(dimension: Dimension) -> &'static str {
    let name = dimension.name();
    name.split_once(' ').map_or(name, |(_, bare)| bare)
}

impl Schema {
    /// Sections directly within the one at `path`.
    pub fn within(&self, path: &str) -> impl Iterator<Item = &Section> {
        let sections = self.sections.iter();
        sections.filter(move |section| section.parent() == Some(path))
    }
}

impl Section {
    /// Last word of the path.
    pub fn name(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// Path of the parent section; `None` for the top level.
    pub fn parent(&self) -> Option<&str> {
        match self.path.rsplit_once('.') {
            Some((parent, _)) => Some(parent),
            None => (!self.path.is_empty()).then_some(""),
        }
    }

    /// Header as written in the text: `[radar.pulse]`, `[[scene.point]]`.
    pub fn header(&self) -> String {
        match (&*self.path, self.presence) {
            ("", _) => "the top level".to_owned(),
            (path, Presence::Many) => format!("[[{path}]]"),
            (path, _) => format!("[{path}]"),
        }
    }

    /// Key called `name`; `None` if there is none.
    pub fn key(&self, name: &str) -> Option<&Key> {
        self.keys.iter().find(|key| key.name == name)
    }
}

impl Key {
    /// Make a key that applies to all values of the selector.
    pub const fn new(
        name: &'static str,
        kind: ValueType,
        need: Requirement,
        doc: &'static str,
    ) -> Self {
        Self {
            name,
            kind,
            need,
            when: &[],
            doc,
        }
    }

    /// Restrict the key to these values of the selector.
    pub const fn when(mut self, values: &'static [&'static str]) -> Self {
        self.when = values;
        self
    }

    /// TOML text of the example or the default.
    pub fn example(&self) -> &'static str {
        match self.need {
            Requirement::Required(text)
            | Requirement::Default(text)
            | Requirement::Optional(text) => text,
        }
    }
}
