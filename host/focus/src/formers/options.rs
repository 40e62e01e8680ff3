//! Descriptions of a former's options, from which a command line is generated, and their conversion to settings.
//!
//! The value of an option is stored in the settings under its key, or at the listed positions: paths through objects, separated by `/`. A position
//! whose object is absent, because it belongs to another mode, is skipped.

use serde_json::{Map, Value};

use super::Entry;

/// Option of a former.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormerOption {
    /// Name: words joined by `_`.
    pub name: &'static str,
    /// One-line description.
    pub summary: &'static str,
    /// Type of the value.
    pub takes: OptionType,
    /// Description of the default; empty if it is evident.
    pub default: &'static str,
    /// Positions in the settings; the key if the list is empty.
    pub at: &'static [&'static str],
    /// Other option, and the word it must have for this option to apply.
    pub with: Option<(&'static str, &'static str)>,
}

/// Type of an option's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OptionType {
    /// Integer of at least 1.
    Count,
    /// Positive length, metres.
    Length,
    /// Error bound, dB, from -120 to -20.
    Bound,
    /// No value; the presence of the option sets the setting to this.
    Switch(bool),
    /// One of several words; the first is the default.
    Word(&'static [OptionWord]),
}

/// Word that an option accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionWord {
    /// Word given by the user.
    pub name: &'static str,
    /// One-line description of the effect.
    pub summary: &'static str,
    /// Setting that the word selects, JSON.
    pub setting: &'static str,
}

/// Options given, by name: numbers, words, and `true` for options without a value.
pub type OptionValues = Map<String, Value>;

/// Error bound option of formers that plan by an error bound.
pub(super) const ERROR_DB: FormerOption = FormerOption {
    name: "error_db",
    summary: "Bound on the relative RMS error against the exact sum, in dB, -20 to -120: formers choose their sizes from it, and \
              refuse an image with a larger predicted error",
    takes: OptionType::Bound,
    default: "-60",
    at: &[],
    with: None,
};

impl FormerOption {
    /// Settings key: the name with its unit.
    pub fn key(&self) -> String {
        match self.takes {
            OptionType::Length => format!("{}_m", self.name),
            _ => self.name.to_owned(),
        }
    }

    /// Convert a value to a setting; `None` if it is invalid.
    fn setting(&self, value: &Value) -> Option<Value> {
        let is_number = |holds: fn(f64) -> bool| value.as_f64().is_some_and(holds);
        let fits = match self.takes {
            OptionType::Count => value.as_u64().is_some_and(|count| count > 0),
            OptionType::Length => is_number(|length_m| length_m > 0.0),
            OptionType::Bound => is_number(|bound_db| (-120.0..=-20.0).contains(&bound_db)),
            OptionType::Switch(made) => return (*value == true).then_some(made.into()),
            OptionType::Word(words) => {
                let word = words.iter().find(|word| *value == word.name)?;
                return Some(serde_json::from_str(word.setting).expect("a setting is JSON"));
            }
        };
        fits.then(|| value.clone())
    }
}

/// Reason that options do not suit a former.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// The former does not have this option.
    #[error("{former} has no option {option}")]
    NotOf {
        /// Name of the former.
        former: &'static str,
        /// Name of the option.
        option: String,
    },
    /// The option has no effect with the word given for another option.
    #[error("{option} has no effect with {other} {word}")]
    NoEffect {
        /// Name of the option.
        option: &'static str,
        /// Name of the other option.
        other: &'static str,
        /// Word given for the other option.
        word: String,
    },
    /// The option requires a word of another option.
    #[error("{option} requires {other} {word}")]
    Needs {
        /// Name of the option.
        option: &'static str,
        /// Name of the other option.
        other: &'static str,
        /// Word required for the other option.
        word: &'static str,
    },
    /// The value is not valid for the option.
    #[error("{value} is not a valid {option}")]
    Value {
        /// Name of the option.
        option: &'static str,
        /// Value given for the option.
        value: Value,
    },
}

impl Entry {
    /// Find an option by name.
    pub fn option(&self, name: &str) -> Option<&'static FormerOption> {
        self.options.iter().find(|option| option.name == name)
    }

    /// Convert `given` options to settings; other settings keep their defaults.
    ///
    /// # Errors
    /// [`OptionError`].
    pub fn settings(&self, given: &OptionValues) -> Result<Value, OptionError> {
        let mut settings = Value::Object(Map::new());
        let mut given_options = Vec::with_capacity(given.len());
        for (name, value) in given {
            let option = self.option(name).ok_or_else(|| OptionError::NotOf {
                former: self.name,
                option: name.clone(),
            })?;
            given_options.push((option, value));
        }
        // Process words first: they create the objects that contain other settings.
        given_options.sort_by_key(|(option, _)| !matches!(option.takes, OptionType::Word(_)));
        for (option, value) in given_options {
            self.check_word(option, given)?;
            let setting = option.setting(value).ok_or_else(|| OptionError::Value {
                option: option.name,
                value: value.clone(),
            })?;
            let key = option.key();
            let own = [key.as_str()];
            let places = if option.at.is_empty() {
                &own[..]
            } else {
                option.at
            };
            for place in places {
                put(&mut settings, place, &setting);
            }
        }
        Ok(settings)
    }

    /// Check that the word required of another option is in force.
    fn check_word(&self, option: &FormerOption, given: &OptionValues) -> Result<(), OptionError> {
        let Some((other, needed)) = option.with else {
            return Ok(());
        };
        let usual = match self.option(other).map(|other| other.takes) {
            Some(OptionType::Word([first, ..])) => first.name,
            _ => "",
        };
        let word = given.get(other).and_then(Value::as_str).unwrap_or(usual);
        if word == needed {
            Ok(())
        } else if needed == usual {
            Err(OptionError::NoEffect {
                option: option.name,
                other,
                word: word.to_owned(),
            })
        } else {
            Err(OptionError::Needs {
                option: option.name,
                other,
                word: needed,
            })
        }
    }
}

/// Set the value at a path through objects if all of them exist.
fn put(settings: &mut Value, path: &str, setting: &Value) {
    let (first, rest) = path
        .split_once('/')
        .map_or((path, None), |(a, b)| (a, Some(b)));
    let Value::Object(object) = settings else {
        return;
    };
    match rest {
        None => {
            object.insert(first.to_owned(), setting.clone());
        }
        Some(rest) => {
            if let Some(inner) = object.get_mut(first) {
                put(inner, rest, setting);
            }
        }
    }
}
