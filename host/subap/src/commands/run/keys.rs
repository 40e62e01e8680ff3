//! Keys of a job, generated from the clap definitions of the settings structs.
//!
//! Name, explanation, default and permitted words of a key are those of the argument. [`Rule`] adds what clap does not state: units and bounds
//! of quantities, and the methods to which a key applies. Examples are the values of [`EXAMPLE`].

use std::any::TypeId;
use std::path::PathBuf;
use std::sync::LazyLock;

use clap::{Arg, ArgAction, Args, Command};
use subaperture::describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture::focus::formers::{FORMERS, FormerOption, OptionType};
use subaperture::units::Dimension;

use super::sections::{CheckSection, FormerSection, QualitySection, Top, TrackSection};
use crate::args;

/// Example job with every section, and its keys with explanations.
pub(crate) const EXAMPLE: &str = include_str!("example.toml");

/// Every key of a job.
pub(crate) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| Schema {
    sections: sections(),
    introduction: "A job: recordings, how they are focused, and the products of the image.",
});

/// Names of all sections except the top level, in order.
pub(crate) fn section_names() -> Vec<&'static str> {
    let sections = SCHEMA.sections.iter();
    let names = sections.map(|section| &*section.path);
    names.filter(|name| !name.is_empty()).collect()
}

/// Names of the keys of a settings struct.
pub(super) fn names<T: Args>() -> Vec<&'static str> {
    let command = T::augment_args(Command::new("settings"));
    let rules = former_rules();
    command
        .get_arguments()
        .map(|arg| name(arg, rule(arg, &rules)))
        .collect()
}

/// Options that overrule keys of other files: no settings of a job.
const NOT_KEYS: [&str; 1] = ["set"];

const LEVEL: ValueType = ValueType::Quantity(Dimension::Level, Bounds::Any);
const LEVEL_SPAN: ValueType = ValueType::Quantity(Dimension::Level, Bounds::Positive);
const ERROR_BOUND: ValueType = ValueType::Quantity(
    Dimension::Level,
    Bounds::Within(-120.0, -20.0, "-20 dB to -120 dB"),
);

const OF_POINTS: &[&str] = &["pga", "mpga-image", "sharpness"];
const PGA: &[&str] = &["pga"];
const SHARPNESS: &[&str] = &["sharpness"];
const MAP_DRIFT: &[&str] = &["map-drift"];
const FUSED: &[&str] = &["fused"];

fn sections() -> Vec<Section> {
    vec![
        section::<Top>("", "", "", &[]),
        section::<args::Input>("input", "", "The recordings.", &[]),
        optional(section::<TrackSection>(
            "track",
            "source",
            "Track of the radar that replaces the recorded positions.",
            &[
                Rule::new("file").when(&["file"]).required(),
                Rule::new("navigation").when(FUSED).required(),
                Rule::new("navigation_start").when(FUSED),
                Rule::new("lever_arm")
                    .when(FUSED)
                    .kind(ValueType::Vector(Dimension::Length)),
            ],
        )),
        optional(section::<args::AutofocusSettings>(
            "autofocus",
            "method",
            "Autofocus: phase errors or a track, estimated before the image is formed.",
            &[
                Rule::new("points").when(OF_POINTS),
                Rule::new("within").when(OF_POINTS).kind(LEVEL_SPAN),
                Rule::new("estimator").when(PGA),
                Rule::new("unknown").when(SHARPNESS),
                Rule::new("goal").when(SHARPNESS),
                Rule::new("patch_pixels").when(SHARPNESS),
                Rule::new("looks")
                    .when(MAP_DRIFT)
                    .kind(ValueType::Count(2, 16)),
            ],
        )),
        section::<args::GridSettings>("grid", "", "Pixels of the image.", &[]),
        section::<FormerSection>("former", "algorithm", "Image former.", &former_section()),
        section::<CheckSection>(
            "check",
            "",
            "Comparison of the image with the exact sum.",
            &[Rule::new("pixels").kind(ValueType::Count(0, 1_000_000))],
        ),
        section::<args::Look>(
            "picture",
            "remap",
            "Picture of the image in the report.",
            &[
                Rule::new("top").when(&["db"]).kind(LEVEL),
                Rule::new("span").when(&["db"]).kind(LEVEL_SPAN),
            ],
        ),
        section::<QualitySection>(
            "quality",
            "",
            "Points to measure.",
            &[
                Rule::new("points").kind(ValueType::Count(0, 64)),
                Rule::new("at").kind(ValueType::Rows(&[Dimension::Length; 2], 1)),
            ],
        ),
        section::<args::Producing>("products", "", "Products for other programs.", &[]),
    ]
}

/// Rules of `[former]`: those of its quantities, and those of the formers' own options.
fn former_section() -> Vec<Rule> {
    let mut rules = former_rules();
    rules.extend([
        Rule::new("squint").kind(ValueType::Quantity(Dimension::Angle, Bounds::Any)),
        Rule::new("doppler_band").kind(ValueType::Quantity(Dimension::Frequency, Bounds::Positive)),
        Rule::new("doppler_centroid").kind(ValueType::Quantity(Dimension::Frequency, Bounds::Any)),
        Rule::new("velocity").kind(ValueType::Vector(Dimension::Speed)),
    ]);
    rules
}

/// Rules of the options of formers, from the list of formers.
fn former_rules() -> Vec<Rule> {
    let rule = |(option, formers): (&'static FormerOption, Vec<(&'static str, _)>)| {
        let formers: Vec<&'static str> = formers.into_iter().map(|(former, _)| former).collect();
        let when: &[&str] = match formers.len() == FORMERS.len() {
            true => &[],
            false => formers.leak(),
        };
        let kind = match option.takes {
            OptionType::Length => Some(ValueType::Quantity(Dimension::Length, Bounds::Positive)),
            OptionType::Bound => Some(ERROR_BOUND),
            _ => None,
        };
        Rule {
            key: args::former_key(option),
            kind,
            ..Rule::new(option.name).when(when)
        }
    };
    args::former_options().into_iter().map(rule).collect()
}

/// Properties of a key that clap does not state.
#[derive(Clone, Copy)]
struct Rule {
    /// Id of the argument.
    id: &'static str,
    /// Name of the key.
    key: &'static str,
    kind: Option<ValueType>,
    /// Values of the section's selector to which the key applies; empty for all.
    when: &'static [&'static str],
    required: bool,
}

impl Rule {
    const fn new(id: &'static str) -> Self {
        Self {
            id,
            key: id,
            kind: None,
            when: &[],
            required: false,
        }
    }

    const fn when(self, when: &'static [&'static str]) -> Self {
        Self { when, ..self }
    }

    const fn kind(self, kind: ValueType) -> Self {
        let kind = Some(kind);
        Self { kind, ..self }
    }

    const fn required(self) -> Self {
        Self {
            required: true,
            ..self
        }
    }
}

/// Section of the settings struct `T`.
fn section<T: Args>(
    path: &'static str,
    selector: &'static str,
    doc: &'static str,
    rules: &[Rule],
) -> Section {
    let command = T::augment_args(Command::new("settings"));
    let keys = command
        .get_arguments()
        .filter(|arg| !NOT_KEYS.contains(&arg.get_id().as_str()))
        .map(|arg| key(path, arg, rule(arg, rules)));
    Section {
        path: path.to_owned(),
        presence: Presence::Always,
        when: &[],
        selector,
        doc,
        keys: keys.collect(),
    }
}

fn optional(section: Section) -> Section {
    Section {
        presence: Presence::Optional,
        ..section
    }
}

fn rule<'r>(arg: &Arg, rules: &'r [Rule]) -> Option<&'r Rule> {
    rules.iter().find(|rule| arg.get_id() == rule.id)
}

fn name(arg: &Arg, rule: Option<&Rule>) -> &'static str {
    match rule {
        Some(rule) => rule.key,
        None => arg.get_id().to_string().leak(),
    }
}

fn key(section: &str, arg: &Arg, rule: Option<&Rule>) -> Key {
    let name = name(arg, rule);
    let kind = rule
        .and_then(|rule| rule.kind)
        .unwrap_or_else(|| value_type(arg));
    let when = rule.map_or(&[][..], |rule| rule.when);
    let required = arg.is_required_set() || rule.is_some_and(|rule| rule.required);
    let default = arg.get_default_values().first();
    let need = match (kind, default) {
        _ if required => Requirement::Required(example(section, name)),
        (ValueType::Flag, _) if when.is_empty() => Requirement::Default("false"),
        (ValueType::Count(..), Some(text)) => {
            Requirement::Default(text.to_string_lossy().into_owned().leak())
        }
        (_, Some(text)) => Requirement::Default(format!("\"{}\"", text.to_string_lossy()).leak()),
        (_, None) => Requirement::Optional(example(section, name)),
    };
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    Key {
        name,
        kind,
        need,
        when,
        doc: format!("{}.", help.trim_end_matches('.')).leak(),
    }
}

/// Type of a key from the action, permitted words and value parser of the argument.
fn value_type(arg: &Arg) -> ValueType {
    let many = matches!(arg.get_action(), ArgAction::Append);
    let words: Vec<&'static str> = arg
        .get_possible_values()
        .iter()
        .map(|value| &*value.get_name().to_owned().leak())
        .collect();
    let parsed = arg.get_value_parser().type_id();
    match arg.get_action() {
        ArgAction::SetTrue => ValueType::Flag,
        _ if !words.is_empty() && many => ValueType::Choices(words.leak()),
        _ if !words.is_empty() => ValueType::Choice(words.leak()),
        _ if parsed == TypeId::of::<PathBuf>() && many => ValueType::Paths,
        _ if parsed == TypeId::of::<PathBuf>() => ValueType::Path,
        _ if parsed == TypeId::of::<usize>() => ValueType::Count(1, u64::MAX),
        _ => ValueType::Text,
    }
}

/// Value of a key in the example, where keys that may be left out stand behind a #. Empty if the example lacks the key.
fn example(section: &str, key: &str) -> &'static str {
    let mut header = "";
    for line in EXAMPLE.lines() {
        let line = line.trim_start_matches(['#', ' ']);
        if let Some((name, _)) = line.strip_prefix('[').and_then(|l| l.split_once(']')) {
            header = name;
        } else if header == section
            && let Some((name, value)) = line.split_once('=')
            && name.trim() == key
        {
            return value.split('#').next().unwrap_or_default().trim();
        }
    }
    ""
}

#[cfg(test)]
mod tests;
