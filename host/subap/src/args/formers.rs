//! `--algorithm` and the options of the image formers, generated from the list of formers.

use clap::builder::{PossibleValue, PossibleValuesParser, ValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches};
use serde::de::{Deserialize, Deserializer, Error};
use serde_json::{Map, Value};
use subaperture::focus::ImageFormer;
use subaperture::focus::formers::{
    self, Entry, FORMERS, FormerOption, OptionError, OptionType, OptionValues,
};
use subaperture::units::Dimension;

use super::settings::defaults;
use super::values::{above_zero, error_bound, positive};
use crate::failure::Usage;

const ALGORITHM: &str = "algorithm";
/// The error bound, which images from maps have too.
const ERROR_DB: &str = "error_db";
/// Key of a job for the error bound, whose value has a unit.
const ERROR_KEY: &str = "error";

/// Former of the list with its options.
#[derive(Clone, Debug)]
pub(crate) struct FormerOptions {
    entry: &'static Entry,
    given: OptionValues,
    /// Whether the former is the user's choice, by its name or by its options.
    named: bool,
}

/// The options of all formers, each name once, and the formers that take it.
pub(crate) fn options() -> Vec<(
    &'static FormerOption,
    Vec<(&'static str, &'static FormerOption)>,
)> {
    let mut options: Vec<(&FormerOption, Vec<(&str, &FormerOption)>)> = Vec::new();
    for entry in &FORMERS {
        for option in entry.options {
            match options
                .iter_mut()
                .find(|(known, _)| known.name == option.name)
            {
                Some((_, takers)) => takers.push((entry.name, option)),
                None => options.push((option, vec![(entry.name, option)])),
            }
        }
    }
    options
}

/// Ids of all of them.
pub(super) fn ids() -> impl Iterator<Item = &'static str> {
    let names = options().into_iter().map(|(option, _)| option.name);
    std::iter::once(ALGORITHM).chain(names)
}

/// The same but for the bound on the error.
pub(super) fn ids_but_the_bound() -> impl Iterator<Item = &'static str> {
    ids().filter(|id| *id != ERROR_DB)
}

/// Help of an option: summary, formers that take it, default.
fn help(option: &FormerOption, takers: &[(&str, &FormerOption)]) -> String {
    let names: Vec<&str> = takers.iter().map(|(name, _)| *name).collect();
    let mut others = FORMERS.iter().map(|entry| entry.name);
    let others: Vec<&str> = others
        .by_ref()
        .filter(|name| !names.contains(name))
        .collect();
    let of = match &others[..] {
        [] => String::new(),
        few if few.len() < names.len() => format!(" (all but {})", few.join(", ")),
        _ => format!(" ({} only)", names.join(", ")),
    };
    let mut default = option.default.to_owned();
    for (name, taken) in takers {
        if taken.default != option.default {
            default = format!("{default}; {name}: {}", taken.default);
        }
    }
    match default.is_empty() {
        true => format!("{}{of}", option.summary),
        false => format!("{}{of} [default: {default}]", option.summary),
    }
}

/// Command-line argument of an option.
fn argument(option: &'static FormerOption, takers: &[(&str, &FormerOption)]) -> Arg {
    let arg = Arg::new(option.name)
        .long(option.name.replace('_', "-"))
        .help(help(option, takers));
    match option.takes {
        OptionType::Count => arg.value_name("N").value_parser(positive),
        OptionType::Length => arg
            .value_name("METRES")
            .allow_negative_numbers(true)
            .value_parser(ValueParser::new(above_zero(Dimension::Length))),
        OptionType::Bound => arg
            .value_name("DB")
            .allow_negative_numbers(true)
            .value_parser(error_bound),
        OptionType::Switch(_) => arg.action(ArgAction::SetTrue),
        OptionType::Word(words) => {
            let word =
                |word: &formers::OptionWord| PossibleValue::new(word.name).help(word.summary);
            arg.value_name(option.name.to_uppercase())
                .value_parser(PossibleValuesParser::new(words.iter().map(word)))
        }
        kind => unreachable!("{kind:?} has no option"),
    }
}

/// Value of an option on the command line.
fn value(option: &FormerOption, matches: &ArgMatches) -> Option<Value> {
    let name = option.name;
    match option.takes {
        OptionType::Count => Some((*matches.get_one::<usize>(name)?).into()),
        OptionType::Length | OptionType::Bound => Some((*matches.get_one::<f64>(name)?).into()),
        OptionType::Switch(_) => matches.get_flag(name).then_some(true.into()),
        OptionType::Word(_) => Some(matches.get_one::<String>(name)?.as_str().into()),
        _ => None,
    }
}

impl clap::Args for FormerOptions {
    fn augment_args(command: Command) -> Command {
        let former = |entry: &Entry| PossibleValue::new(entry.name).help(entry.summary);
        let algorithm = Arg::new(ALGORITHM)
            .long(ALGORITHM)
            .short('a')
            .value_name("ALGORITHM")
            .help("Image former. On the command line, options of one former imply it")
            .value_parser(PossibleValuesParser::new(FORMERS.iter().map(former)))
            .default_value(formers::DEFAULT.name);
        let options = options();
        let options = options
            .iter()
            .map(|(option, takers)| argument(option, takers));
        command.arg(algorithm).args(options)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for FormerOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = options()
            .into_iter()
            .filter_map(|(option, _)| Some((option.name.to_owned(), value(option, matches)?)));
        let given: OptionValues = given.collect();
        let name = matches.get_one::<String>(ALGORITHM);
        let named = FORMERS
            .iter()
            .find(|entry| name.is_some_and(|name| name == entry.name))
            .expect("no other word is taken, and one is there by default");
        let takes = |entry: &&Entry| given.keys().all(|option| entry.option(option).is_some());
        let entry = match matches.value_source(ALGORITHM) {
            Some(ValueSource::DefaultValue) if !takes(&named) => FORMERS.iter().find(takes),
            _ => None,
        };
        let typed = matches.value_source(ALGORITHM) != Some(ValueSource::DefaultValue);
        Ok(Self {
            named: typed || entry.is_some(),
            entry: entry.unwrap_or(named),
            given,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Key of a job that holds an option.
pub(crate) fn key(option: &FormerOption) -> &'static str {
    match option.name {
        ERROR_DB => ERROR_KEY,
        name => name,
    }
}

impl Default for FormerOptions {
    fn default() -> Self {
        defaults()
    }
}

/// From the keys of a job, checked against its schema. The former is named if it is not the default.
impl<'de> Deserialize<'de> for FormerOptions {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let keys = Map::deserialize(from)?;
        let name = keys.get(ALGORITHM).and_then(Value::as_str);
        let name = name.unwrap_or(formers::DEFAULT.name);
        let entry = FORMERS.iter().find(|entry| entry.name == name);
        let entry = entry.ok_or_else(|| D::Error::custom(format!("unknown former '{name}'")))?;
        let given = options().into_iter().filter_map(|(option, _)| {
            let value = keys.get(key(option)).filter(|value| **value != false)?;
            Some((option.name.to_owned(), value.clone()))
        });
        Ok(Self {
            entry,
            given: given.collect(),
            named: name != formers::DEFAULT.name,
        })
    }
}

impl FormerOptions {
    /// Whether the former is the user's choice, by its name or by its options.
    pub(crate) fn is_named(&self) -> bool {
        self.named
    }

    /// Whether an error bound was given, instead of left to its default.
    pub(crate) fn has_bound(&self) -> bool {
        self.given.contains_key(ERROR_DB)
    }

    /// The former with its options.
    ///
    /// # Errors
    /// [`Usage`] for an option that it does not take.
    pub(crate) fn former(&self) -> Result<Box<dyn ImageFormer>, Usage> {
        let typed = |option: &str| format!("--{}", option.replace('_', "-"));
        let settings = self.entry.settings(&self.given).map_err(|error| {
            Usage(match error {
                OptionError::NotOf { former, option } => {
                    let option = typed(&option);
                    format!("{option} has no effect with --algorithm {former}: leave it out")
                }
                OptionError::NoEffect {
                    option,
                    other,
                    word,
                } => {
                    let [option, other] = [option, other].map(typed);
                    format!("{option} has no effect with {other} {word}: leave it out")
                }
                OptionError::Needs {
                    option,
                    other,
                    word,
                } => {
                    let [option, other] = [option, other].map(typed);
                    format!("{option} is for {other} {word} only: leave it out")
                }
                error => error.to_string(),
            })
        })?;
        formers::former(self.entry.name, &settings).map_err(|error| Usage(error.to_string()))
    }

    /// The bound on the error, dB, if one was given.
    pub(crate) fn error_db(&self) -> Option<f64> {
        self.given.get(ERROR_DB).and_then(Value::as_f64)
    }

    /// All options for the record; `null` or `false` if not given.
    pub(crate) fn record(&self) -> Map<String, Value> {
        let options = options().into_iter().map(|(option, _)| {
            let absent = match option.takes {
                OptionType::Switch(_) => Value::Bool(false),
                _ => Value::Null,
            };
            let value = self.given.get(option.name).cloned();
            (option.key(), value.unwrap_or(absent))
        });
        options.collect()
    }
}
