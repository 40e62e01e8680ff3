//! What a former can be told, described so that a command line can be made of it, and how that becomes its settings.
//!
//! An option's value stands in the settings at its key, or at the places that it names: ways through objects, parted by `/`. A place
//! whose object is not there, for it is another mode's, is passed over.

use serde_json::{Map, Value};

use super::Entry;

/// An option of a former.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opt {
    /// Its name: words joined by `_`.
    pub name: &'static str,
    /// What it is, in a line.
    pub summary: &'static str,
    /// What is given with it.
    pub takes: Takes,
    /// What holds where it is not given, in words; empty if that goes without saying.
    pub default: &'static str,
    /// Its places in the settings; its key if there are none.
    pub at: &'static [&'static str],
    /// Another option and the word of it with which alone this one says something.
    pub with: Option<(&'static str, &'static str)>,
}

/// What is given with an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Takes {
    /// A whole number from 1.
    Count,
    /// A length above 0, metres.
    Length,
    /// A bound on an error, dB, from -120 to -20.
    Bound,
    /// Nothing: that it is given makes this of the setting.
    Switch(bool),
    /// One of some words; the first if it is not given.
    Word(&'static [Word]),
}

/// A word that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// The word.
    pub name: &'static str,
    /// What it means, in a line.
    pub summary: &'static str,
    /// The setting that it makes, JSON.
    pub setting: &'static str,
}

/// Options given, by name: numbers, words, and `true` for what takes nothing.
pub type Given = Map<String, Value>;

/// The bound that formers which plan by it are told.
pub(super) const ERROR_DB: Opt = Opt {
    name: "error_db",
    summary: "Bound on the relative RMS error against the exact sum, in dB, -20 to -120: formers choose their sizes from it, and \
              refuse what they predict to miss it",
    takes: Takes::Bound,
    default: "-60",
    at: &[],
    with: None,
};

impl Opt {
    /// Its name with its unit, as records have it.
    pub fn key(&self) -> String {
        match self.takes {
            Takes::Length => format!("{}_m", self.name),
            _ => self.name.to_owned(),
        }
    }

    /// The setting that `value` makes.
    fn setting(&self, value: &Value) -> Option<Value> {
        let is_number = |holds: fn(f64) -> bool| value.as_f64().is_some_and(holds);
        let fits = match self.takes {
            Takes::Count => value.as_u64().is_some_and(|count| count > 0),
            Takes::Length => is_number(|length_m| length_m > 0.0),
            Takes::Bound => is_number(|bound_db| (-120.0..=-20.0).contains(&bound_db)),
            Takes::Switch(made) => return (*value == true).then_some(made.into()),
            Takes::Word(words) => {
                let word = words.iter().find(|word| *value == word.name)?;
                return Some(serde_json::from_str(word.setting).expect("a setting is JSON"));
            }
        };
        fits.then(|| value.clone())
    }
}

/// Why options are none of a former.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// The former has no such option.
    #[error("{former} takes no {option}")]
    NotOf {
        /// The former's name.
        former: &'static str,
        /// The option's.
        option: String,
    },
    /// Another option's word, which was given, leaves it nothing to say.
    #[error("{option} says nothing with {other} {word}")]
    SaysNothing {
        /// The option's name.
        option: &'static str,
        /// The other's.
        other: &'static str,
        /// The word given with that.
        word: String,
    },
    /// It needs a word of another option.
    #[error("{option} is for {other} {word} only")]
    Needs {
        /// The option's name.
        option: &'static str,
        /// The other's.
        other: &'static str,
        /// The word that has to be given with that.
        word: &'static str,
    },
    /// A value that it does not take.
    #[error("{option} cannot be {value}")]
    Value {
        /// The option's name.
        option: &'static str,
        /// What was given.
        value: Value,
    },
}

impl Entry {
    /// The option of this name.
    pub fn option(&self, name: &str) -> Option<&'static Opt> {
        self.options.iter().find(|option| option.name == name)
    }

    /// The settings that `given` makes, all else by default.
    ///
    /// # Errors
    /// [`OptionError`].
    pub fn settings(&self, given: &Given) -> Result<Value, OptionError> {
        let mut settings = Value::Object(Map::new());
        let mut given_options = Vec::with_capacity(given.len());
        for (name, value) in given {
            let option = self.option(name).ok_or_else(|| OptionError::NotOf {
                former: self.name,
                option: name.clone(),
            })?;
            given_options.push((option, value));
        }
        // Words first: the objects that others are placed in are theirs.
        given_options.sort_by_key(|(option, _)| !matches!(option.takes, Takes::Word(_)));
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

    /// Whether the word that `option` needs of another is in force.
    fn check_word(&self, option: &Opt, given: &Given) -> Result<(), OptionError> {
        let Some((other, needed)) = option.with else {
            return Ok(());
        };
        let usual = match self.option(other).map(|other| other.takes) {
            Some(Takes::Word([first, ..])) => first.name,
            _ => "",
        };
        let word = given.get(other).and_then(Value::as_str).unwrap_or(usual);
        if word == needed {
            Ok(())
        } else if needed == usual {
            Err(OptionError::SaysNothing {
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

/// Sets what a way through objects leads to, if they are there.
fn put(settings: &mut Value, way: &str, setting: &Value) {
    let (first, rest) = way
        .split_once('/')
        .map_or((way, None), |(a, b)| (a, Some(b)));
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
