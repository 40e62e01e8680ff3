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
    sections: sections()
        .into_iter()
        .map(|section| &*Box::leak(Box::new(section)))
        .collect::<Vec<_>>()
        .leak(),
    introduction: "A job: recordings, how they are focused, and the products of the image.",
});

/// Names of all sections except the top level, in order.
pub(crate) fn section_names() -> Vec<&'static str> {
    let sections = SCHEMA.sections.iter();
    let names = sections.map(|section| section.path);
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
        path,
        presence: Presence::Always,
        when: &[],
        selector,
        doc,
        keys: keys.collect::<Vec<_>>().leak(),
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
mod tests {
    use std::path::Path;

    use serde_json::json;
    use subaperture::describe::{Description, DescriptionError};
    use subaperture::job::JobText;

    use super::*;
    use crate::commands::run::sections::Sections;

    fn job(text: &str) -> Result<(JobText, Sections), DescriptionError> {
        let job = JobText::new(Description::new("job.toml", text, "/data"), &SCHEMA)?;
        let sections = Sections::read(&job).map_err(|faults| job.explain(faults))?;
        Ok((job, sections))
    }

    #[test]
    fn the_example_is_a_job_and_names_every_section_and_key() {
        let (job, _) = job(EXAMPLE).unwrap();
        assert_eq!(job.path("a.cphd"), Path::new("/data/a.cphd"));
        for section in SCHEMA.sections {
            let header = section.header();
            assert!(
                section.path.is_empty() || EXAMPLE.contains(&header),
                "{header}"
            );
            for key in section.keys {
                let example = example(section.path, key.name);
                assert!(!example.is_empty(), "{header} {}", key.name);
                assert!(!key.doc.is_empty(), "{header} {}", key.name);
                if let Requirement::Default(default) = key.need
                    && !section.keys.iter().any(|key| key.name == "source")
                {
                    assert_eq!(example, default, "{header} {}", key.name);
                }
            }
        }
    }

    #[test]
    fn every_example_of_the_example_is_valid() {
        let selected = [
            ("track", "source"),
            ("autofocus", "method"),
            ("former", "algorithm"),
            ("picture", "remap"),
        ];
        for section in SCHEMA.sections {
            for key in section.keys {
                let selector = selected.iter().find(|(name, _)| *name == section.path);
                let mut lines = vec![format!("{} = {}", key.name, key.example())];
                if let (Some((_, selector)), [value, ..]) = (selector, key.when) {
                    lines.push(format!("{selector} = \"{value}\""));
                }
                // Keys that others need.
                lines.extend(match (section.path, key.name) {
                    ("former", "squint") => Some("beam = \"auto\"".to_owned()),
                    ("track", "navigation_start" | "lever_arm") => {
                        Some("navigation = \"a.log\"".to_owned())
                    }
                    ("track", "source") => None,
                    _ => None,
                });
                let lines = lines.join("\n");
                let text = match section.path {
                    "" => format!("{lines}\n[input]\nfiles = \"a\"\n"),
                    "input" if key.name == "files" => format!("[input]\n{lines}\n"),
                    "input" => format!("[input]\nfiles = \"a\"\n{lines}\n"),
                    path => format!("[input]\nfiles = \"a\"\n[{path}]\n{lines}\n"),
                };
                if let Err(error) = job(&text) {
                    panic!("{text}\n{error}");
                }
            }
        }
    }

    #[test]
    fn settings_take_defaults_and_omit_unrequested_stages() {
        let (job, _) = job("[input]\nfiles = \"a.cphd\"\n[former]\nerror = \"-40 dB\"\n").unwrap();
        let settings = job.settings(&["former", "autofocus", "check"]);
        assert_eq!(settings["former.error"], json!(-40.0));
        assert_eq!(settings["former.algorithm"], json!("auto"));
        assert_eq!(settings["check.pixels"], json!(64));
        assert!(!settings.keys().any(|key| key.starts_with("autofocus")));
    }

    #[test]
    fn a_value_of_a_key_is_that_of_its_option() {
        let text = "[input]\nfiles = [\"a.cphd\", \"/b.cphd\"]\n[grid]\npixels = \"x=-1:1:0.5,y=0:2:1\"\nsurface = \"dem:heights\"\n\
                    [former]\nalgorithm = \"rdbp\"\nerror = \"-50 dB\"\npatch = \"8 m\"\nslow_window = \"hamming\"\nbeam = \"2 deg\"\n\
                    squint = \"-1.5 deg\"\nvelocity = \"36, 0, 0 km/h\"\nscratch = \"1M\"\n[picture]\ntop = \"-10 dB\"\nspan = \"45 dB\"\n\
                    [autofocus]\nmethod = \"map-drift\"\nlooks = 3\n[quality]\nat = [\"1, 2 m\"]\n[products]\nplace = \"40, -86\"\n";
        let (_, sections) = job(text).unwrap();
        let line = "subap focus /data/a.cphd /b.cphd --grid x=-1:1:0.5,y=0:2:1 --surface dem:/data/heights -a rdbp --error-db -50 --patch 8 \
                    --slow-window hamming --beam 2deg --squint -1.5deg --velocity 36,0,0km/h --scratch 1M --top -10 --span 45 --out d \
                    --product cog --place 40,-86";
        let args = <args::Args as clap::Parser>::try_parse_from(line.split_whitespace()).unwrap();
        let Some(args::Command::Focus(focus)) = args.command else {
            panic!("not focus");
        };
        let same = |own: &dyn std::fmt::Debug, options: &dyn std::fmt::Debug| {
            assert_eq!(format!("{own:?}"), format!("{options:?}"));
        };
        same(&sections.input, &focus.input);
        same(&sections.grid, &focus.image.grid);
        same(&sections.former.forming, &focus.image.forming);
        same(&sections.former.motion, &focus.motion);
        same(&sections.picture, &focus.look);
        same(&sections.products.place, &focus.producing.place);
        let autofocus = sections.autofocus.unwrap();
        assert_eq!(
            (autofocus.method, autofocus.looks),
            (args::Method::MapDrift, 3)
        );
        assert_eq!((autofocus.rounds, autofocus.points), (16, None));
        let at = sections.quality.places.at[0];
        assert_eq!(
            (at.x, at.y, at.z, sections.quality.points),
            (1.0, 2.0, None, 5)
        );
    }

    #[test]
    fn formers_and_all_their_options_are_keys() {
        let former = SCHEMA.sections.iter().find(|s| s.path == "former").unwrap();
        let ValueType::Choice(names) = former.key("algorithm").unwrap().kind else {
            panic!("not a choice");
        };
        for entry in &FORMERS {
            assert!(names.contains(&entry.name), "{}", entry.name);
            for option in entry.options {
                let name = args::former_key(option);
                let key = former.key(name).unwrap_or_else(|| panic!("no key {name}"));
                let takes = key.when.is_empty() || key.when.contains(&entry.name);
                assert!(takes, "{name} of {}", entry.name);
            }
        }
        assert_eq!(names.len(), FORMERS.len());
    }

    #[test]
    fn faults_are_shown_with_their_line() {
        for (text, place, parts) in [
            (
                "[inptu]\nfiles = \"a\"\n",
                "job.toml:1:2",
                ["inptu", "did you mean 'input'"],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nalgorithm = \"ffpb\"\n",
                "job.toml:4:13",
                ["ffpb", "did you mean \"ffbp\""],
            ),
            (
                "[input]\nfiles = \"a\"\n[products]\nformats = [\"sicd\", \"cogs\"]\n",
                "job.toml:4:20",
                ["cogs", "did you mean \"cog\""],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nerror = -40\n",
                "job.toml:4:9",
                ["error", "without a unit"],
            ),
            (
                "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\n[autofocus]\n",
                "job.toml:5:1",
                ["as recorded", "leave one of the two out"],
            ),
            (
                "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\nfile = \"t.csv\"\n",
                "job.toml:5:1",
                ["file", "does not apply"],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nwindow = \"blackman\"\nbeam = \"wide\"\n",
                "job.toml:5:8",
                ["or auto, or none", "give an angle"],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nsquint = \"2 deg\"\n",
                "job.toml:4:10",
                ["'squint' needs 'beam'", "beam = "],
            ),
            (
                "[input]\nfiles = \"a\"\n[picture]\nremap = \"density\"\nspan = \"40 dB\"\n",
                "job.toml:5:1",
                [
                    "'span' does not apply to remap = \"density\"",
                    "choose \"db\"",
                ],
            ),
            (
                "[input]\nfiles = [\"a\", \"b\"]\n[track]\nsource = \"mpga\"\n",
                "job.toml:2:9",
                ["estimated from one recording", "name one file"],
            ),
        ] {
            let error = job(text).map(|_| ()).unwrap_err();
            let fault = error.faults.iter().find(|fault| fault.place == place);
            let fault = fault.unwrap_or_else(|| panic!("{place}: {error}"));
            assert!(fault.excerpt.contains('^'), "{error}");
            for part in parts {
                assert!(fault.message.contains(part), "{part}: {error}");
            }
        }
        let none = job("").map(|_| ()).unwrap_err().to_string();
        assert!(none.contains("files"), "{none}");
    }
}
