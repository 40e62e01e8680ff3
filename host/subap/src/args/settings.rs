//! Settings that the options of a command share with the keys of a job.
//!
//! A settings struct is defined once. Its clap attributes make the options; its serde attributes read the same fields from a section of a
//! job, whose keys have the names of the fields (`commands::run::keys`).

use std::fmt::Display;
use std::str::FromStr;

use clap::{Args, Command};
use serde::de::{Deserialize, Deserializer, Error};

/// The settings of a command line that gives none of their options.
pub(crate) fn defaults<T: Args>() -> T {
    let command = T::augment_args(Command::new("defaults").no_binary_name(true));
    let command = command.mut_args(|arg| arg.required(false));
    let none: [&str; 0] = [];
    command
        .try_get_matches_from(none)
        .and_then(|matches| T::from_arg_matches(&matches))
        .expect("settings have defaults or may be absent")
}

/// Read a value from the text of a key, which is that of the option.
pub(super) fn parsed<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    from: D,
) -> Result<T, D::Error> {
    parsed_by(from, str::parse)
}

/// As [`parsed`], for an option without a default.
pub(super) fn optional<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    parsed(from).map(Some)
}

/// As [`parsed`], by the value parser of the option.
pub(super) fn parsed_by<'de, D: Deserializer<'de>, T, E: Display>(
    from: D,
    parse: impl Fn(&str) -> Result<T, E>,
) -> Result<T, D::Error> {
    parse(&String::deserialize(from)?).map_err(D::Error::custom)
}
