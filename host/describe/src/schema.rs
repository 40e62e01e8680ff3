//! What a description can say: how keys and sections are described.

use subaperture_model::units::{Dimension, example_row};

/// All that a description can say, for one purpose.
#[derive(Debug)]
pub struct Schema {
    /// Every section, those within others after them; the top is the first.
    pub sections: &'static [&'static Section],
    /// What the reference of keys begins with.
    pub introduction: &'static str,
}

/// A table of the text, or an array of tables.
#[derive(Debug)]
pub struct Section {
    /// Dotted path; empty for the top.
    pub path: &'static str,
    /// How often it comes.
    pub presence: Presence,
    /// Values of the parent's selector with which it makes sense; with all if empty.
    pub when: &'static [&'static str],
    /// The key whose value decides which others make sense; empty if there is none.
    pub selector: &'static str,
    /// Its explanation.
    pub doc: &'static str,
    /// Its keys.
    pub keys: &'static [Key],
}

/// How often a section comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Once, or left out where none of its keys is required: it is then made of defaults.
    Always,
    /// Once or not at all.
    Optional,
    /// Any number of times.
    Many,
}

/// A key of a section.
#[derive(Debug)]
pub struct Key {
    /// How the text names it.
    pub name: &'static str,
    /// What its value is.
    pub kind: Kind,
    /// Whether it has to be given.
    pub need: Need,
    /// Values of the section's selector with which it makes sense; with all if empty.
    pub when: &'static [&'static str],
    /// Its explanation.
    pub doc: &'static str,
}

/// What a value is.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// Any text.
    Text,
    /// A path, relative to the description's folder.
    Path,
    /// A path or an array of paths, relative to the description's folder; `{01..64}` in one stands for numbers in turn.
    Paths,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// One of these words, or an array of them.
    Choices(&'static [&'static str]),
    /// `true` or `false`.
    Flag,
    /// A whole number within these bounds.
    Count(u64, u64),
    /// A quantity.
    Quantity(Dimension, Bounds),
    /// Three quantities: x, y and z.
    Vector(Dimension),
    /// Two quantities, the second larger.
    Interval(Dimension),
    /// An array of texts, a row of quantities in each; at least so many rows.
    Rows(&'static [Dimension], usize),
}

/// What a quantity may be, in SI units.
#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    /// Any finite number.
    Any,
    /// Above zero.
    Positive,
    /// Zero or more.
    NotNegative,
    /// From and to, and the same in words.
    Within(f64, f64, &'static str),
}

/// Whether a key has to be given. The text is TOML: an example, the default, an example.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// It has to be; an example.
    Required(&'static str),
    /// Where it is not, this is taken.
    Default(&'static str),
    /// It may be left out; an example.
    Optional(&'static str),
}

/// Smallest positive value: below all that is measured in seconds, metres or hertz here, and far from
/// where float64 loses digits.
const SMALLEST: f64 = 1e-18;

impl Bounds {
    /// What a value has to be instead, if it is out of bounds.
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

impl Kind {
    /// In words, for the reference.
    pub fn words(self) -> String {
        match self {
            Self::Text => "text".to_owned(),
            Self::Path => "path, from the folder of this file".to_owned(),
            Self::Paths => "path or array of paths, from the folder of this file; {01..64} in one stands for these \
                            numbers in turn"
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
                    "array of {least} or more texts as {}",
                    example_row(dimensions)
                )
            }
        }
    }
}

/// A dimension's name without its article.
fn bare(dimension: Dimension) -> &'static str {
    let name = dimension.name();
    name.split_once(' ').map_or(name, |(_, bare)| bare)
}

impl Schema {
    /// The sections directly within the one at `path`.
    pub fn within(&self, path: &str) -> impl Iterator<Item = &'static Section> {
        let sections = self.sections.iter().copied();
        sections.filter(move |section| section.parent() == Some(path))
    }
}

impl Section {
    /// The last word of the path.
    pub fn name(&self) -> &'static str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// The path of the section that this one is in; `None` of the top.
    pub fn parent(&self) -> Option<&'static str> {
        match self.path.rsplit_once('.') {
            Some((parent, _)) => Some(parent),
            None => (!self.path.is_empty()).then_some(""),
        }
    }

    /// As the text writes it: `[radar.pulse]`, `[[scene.point]]`.
    pub fn header(&self) -> String {
        match (self.path, self.presence) {
            ("", _) => "the top of the text".to_owned(),
            (path, Presence::Many) => format!("[[{path}]]"),
            (path, _) => format!("[{path}]"),
        }
    }

    /// The key of this name.
    pub fn key(&self, name: &str) -> Option<&'static Key> {
        self.keys.iter().find(|key| key.name == name)
    }
}

impl Key {
    /// A key that makes sense with all values of the selector.
    pub const fn new(name: &'static str, kind: Kind, need: Need, doc: &'static str) -> Self {
        Self {
            name,
            kind,
            need,
            when: &[],
            doc,
        }
    }

    /// Makes sense with these values of the selector only.
    pub const fn when(mut self, values: &'static [&'static str]) -> Self {
        self.when = values;
        self
    }

    /// The TOML text of an example or the default.
    pub fn example(&self) -> &'static str {
        match self.need {
            Need::Required(text) | Need::Default(text) | Need::Optional(text) => text,
        }
    }
}
