//! The command line as clap parses it, with groups of commands, examples and short help added from tables.

use clap::builder::styling::{AnsiColor, Effects, Styles};
use clap::{Command, CommandFactory, FromArgMatches};

use super::Args;
use crate::arguments::arguments;

/// Commands by group, in the order of the help. Every command belongs to exactly one group.
const GROUPS: [(&str, &[&str]); 8] = [
    (
        "form",
        &["focus", "velocity", "gmti", "run", "link", "module"],
    ),
    (
        "inspect",
        &[
            "info",
            "recording",
            "compare",
            "pair",
            "displacement",
            "quality",
            "view",
            "crosscheck",
        ],
    ),
    ("simulate", &["simulate", "demo", "reproduce"]),
    ("radio", &["radio", "capture", "live", "profile"]),
    ("motion", &["track", "navigation", "autofocus", "tune"]),
    ("export", &["export", "picture"]),
    ("plan", &["plan"]),
    ("help", &["completions", "man", "help"]),
];

/// Examples of each command, one a line.
const EXAMPLES: [(&str, &str); 40] = [
    (
        "focus",
        "subap focus scene.cphd --out image\n\
         subap focus scene.cphd --grid x=-50:50:0.2,y=-50:50:0.2 --error-db -60 --check 100 --out image",
    ),
    (
        "velocity",
        "subap velocity scene.cphd --at 0,0 --vx -1:1:0.1 --vy -1:1:0.1 --out plane",
    ),
    ("gmti", "subap gmti flight.cphd -o targets.geojson"),
    ("run", "subap run job.toml"),
    (
        "link",
        "subap link tcp://localhost:4000 scene.cphd --send image --out image\nsubap link tcp://localhost:4000 scene.cphd -o scene.maps\nsubap focus --from-maps scene.maps --out image\nsubap link tcp://localhost:4000 walk.cphd --send increments -o track.csv",
    ),
    ("module", "subap module selftest emulate -o report.json"),
    (
        "module selftest",
        "subap module selftest serial:/dev/ttyACM0 -o report.json",
    ),
    ("info", "subap info scene.cphd"),
    ("recording", "subap recording --keys"),
    ("compare", "subap compare image exact --error-db -60"),
    (
        "pair",
        "subap pair later earlier --out change\nsubap pair later earlier --looks 9x5 --pfa 1e-4 --format cog,zarr --out change",
    ),
    (
        "displacement",
        "subap displacement pass1 pass2 pass3 --out motion\nsubap displacement pass1 pass2 pass3 --stable -50:50,200:260 --format cog,zarr --out motion",
    ),
    ("quality", "subap quality image --at 0,0"),
    ("view", "subap view image"),
    ("crosscheck", "subap crosscheck scene.cphd"),
    (
        "simulate",
        "subap simulate --preset table-4-1 -o scene.cphd",
    ),
    ("demo", "subap demo --out demo"),
    ("reproduce", "subap reproduce --list"),
    ("radio", "subap radio list"),
    ("radio list", "subap radio list"),
    ("radio probe", "subap radio probe experiment.toml"),
    (
        "radio selftest",
        "subap radio selftest experiment.toml -o report.json",
    ),
    (
        "radio calibrate",
        "subap radio calibrate --sky sky --reflector corner --range 4 -o calibration.json",
    ),
    (
        "radio convert",
        "subap radio convert capture --track rail.csv --reference 0,4 -o capture.cphd",
    ),
    (
        "capture",
        "subap capture --example thesis > thesis.toml\nsubap capture thesis.toml -o capture",
    ),
    ("live", "subap live experiment.toml -o capture"),
    ("profile", "subap profile capture --out profile"),
    ("track", "subap track recording.toml -o track.csv"),
    ("navigation", "subap navigation flight.log -o track.csv"),
    (
        "autofocus",
        "subap autofocus scene.cphd -o phase.csv\nsubap focus scene.cphd --phase phase.csv --out image",
    ),
    (
        "tune",
        "subap tune rec.toml --vary platform.radius=0.18:0.25:0.005m --grid x=-3:3:0.05,y=2:8:0.05",
    ),
    ("export", "subap export image -o image.nitf"),
    ("picture", "subap picture image -o picture.png"),
    ("plan", "subap plan radar --carrier 9.6GHz"),
    ("plan focus", "subap plan focus scene.cphd -o scene.plan"),
    ("plan module", "subap plan module --ram 512K scene.cphd"),
    ("plan calibrate", "subap plan calibrate -o model.json"),
    ("plan radar", "subap plan radar --carrier 9.6GHz"),
    ("completions", "subap completions bash > subap.bash"),
    ("man", "subap man plan focus > subap-plan-focus.1"),
];

/// Options in `-h` of commands whose whole help is longer than a screen, by command. `--help` shows all options.
const SHORT: [(&str, &[&str]); 16] = [
    (
        "displacement",
        &[
            "out",
            "times",
            "stable",
            "dispersion",
            "floor",
            "screen",
            "formats",
            "force",
        ],
    ),
    (
        "focus",
        &[
            "out",
            "pixels",
            "algorithm",
            "error_db",
            "window",
            "velocity",
            "phase",
            "check",
        ],
    ),
    (
        "velocity",
        &[
            "at", "vx", "vy", "vz", "out", "error_db", "window", "channel", "force", "dry_run",
        ],
    ),
    (
        "gmti",
        &[
            "out",
            "picture",
            "channels",
            "dwell",
            "false_alarms",
            "grid",
            "error_db",
            "window",
            "force",
        ],
    ),
    (
        "link",
        &[
            "out", "send", "grid", "error_db", "rate", "retries", "verify", "picture", "firmware",
            "dry_run",
        ],
    ),
    (
        "simulate",
        &[
            "preset", "set", "keys", "example", "out", "echoes", "noise_db", "force", "dry_run",
        ],
    ),
    (
        "track",
        &[
            "out",
            "channels",
            "set",
            "picture",
            "range",
            "targets",
            "least_snr",
            "navigation",
            "force",
        ],
    ),
    (
        "autofocus",
        &[
            "method", "out", "picture", "channel", "grid", "measure", "rounds", "points",
            "unknown", "force",
        ],
    ),
    (
        "tune",
        &[
            "vary", "set", "grid", "at", "refine", "write", "out", "force",
        ],
    ),
    (
        "plan focus",
        &[
            "out",
            "channel",
            "pixels",
            "algorithm",
            "error_db",
            "window",
            "force",
        ],
    ),
    (
        "plan radar",
        &[
            "carrier",
            "bandwidth",
            "range",
            "velocity",
            "prf",
            "scene",
            "power",
            "pulse_length",
            "chain",
            "plots",
        ],
    ),
    (
        "capture",
        &[
            "out", "set", "keys", "example", "replay", "live", "page", "module", "profiles",
        ],
    ),
    (
        "live",
        &["out", "image", "set", "window", "error_db", "page", "force"],
    ),
    (
        "export",
        &[
            "format",
            "out",
            "place",
            "projection",
            "pixel",
            "looks",
            "remap",
            "top",
            "span",
            "force",
        ],
    ),
    (
        "picture",
        &[
            "out",
            "looks",
            "sub_apertures",
            "top",
            "span",
            "remap",
            "colours",
            "force",
        ],
    ),
    (
        "quality",
        &[
            "at", "from", "against", "extent", "window", "plots", "force", "dry_run",
        ],
    ),
];

/// Colours of cargo's help. They are left out where the output is no terminal or `NO_COLOR` is set.
const STYLES: Styles = Styles::styled()
    .header(AnsiColor::BrightGreen.on_default().effects(Effects::BOLD))
    .usage(AnsiColor::BrightGreen.on_default().effects(Effects::BOLD))
    .literal(AnsiColor::BrightCyan.on_default().effects(Effects::BOLD))
    .placeholder(AnsiColor::Cyan.on_default())
    .error(AnsiColor::BrightRed.on_default().effects(Effects::BOLD))
    .valid(AnsiColor::BrightCyan.on_default().effects(Effects::BOLD))
    .invalid(AnsiColor::Yellow.on_default().effects(Effects::BOLD));

/// The whole command line with its help.
pub(crate) fn command() -> Command {
    let all = Args::command();
    let template = template(&all);
    with_examples(all, "")
        .styles(STYLES)
        .help_template(template)
}

/// Parse the arguments of this process.
///
/// # Errors
/// Help, version, or wrong usage.
pub(crate) fn parse() -> Result<Args, clap::Error> {
    let matches = command().try_get_matches_from(arguments())?;
    Args::from_arg_matches(&matches).map_err(|error| error.format(&mut command()))
}

/// Help template with the commands under the names of their groups.
fn template(all: &Command) -> String {
    let header = STYLES.get_header();
    let literal = STYLES.get_literal();
    let names = GROUPS.iter().flat_map(|(_, names)| names.iter());
    let width = names.map(|name| name.len()).max().unwrap_or(0);
    let mut list = format!("{header}Commands:{header:#}\n");
    for (group, names) in GROUPS {
        list += &format!(" {header}{group}{header:#}\n");
        for name in names {
            let about = match all.find_subcommand(name) {
                Some(command) => command.get_about().map(ToString::to_string),
                None if *name == "help" => Some("Print the help of a command".to_owned()),
                // Not in this build.
                None => continue,
            };
            let about = about.unwrap_or_default();
            let about = wrapped(&about, WIDTH - width - 4);
            let about = about.join(&format!("\n{:1$}", "", width + 4));
            list += &format!("  {literal}{name:<width$}{literal:#}  {about}\n");
        }
    }
    format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}\n{header}Options:{header:#}\n{{options}}{{after-help}}"
    )
}

/// Largest width of the list of commands, columns.
const WIDTH: usize = 100;

/// Lines of at most `width` columns, broken between words. A longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn of<T: Copy>(table: &[(&str, T)], name: &str) -> Option<T> {
    let mut rows = table.iter();
    rows.find(|(other, _)| *other == name).map(|(_, row)| *row)
}

/// Add examples, and the short help, to all commands below `command`, whose full name is `name`.
fn with_examples(command: Command, name: &str) -> Command {
    let below: Vec<String> = command
        .get_subcommands()
        .map(|below| below.get_name().to_owned())
        .collect();
    let command = below.into_iter().fold(command, |command, word| {
        let name = format!("{name} {word}");
        command.mut_subcommand(word, |below| with_examples(below, name.trim_start()))
    });
    if name.is_empty() {
        return command;
    }
    let mut long = command
        .get_after_help()
        .map_or_else(String::new, |text| format!("{text}\n\n"));
    if let Some(lines) = of(&EXAMPLES, name).filter(|_| !long.contains("Example:")) {
        long += "Example:\n";
        lines
            .lines()
            .for_each(|line| long += &format!("  {line}\n"));
    }
    let command = match of(&SHORT, name) {
        Some(shown) => command.mut_args(|arg| {
            let hide = !arg.is_positional() && !shown.contains(&arg.get_id().as_str());
            arg.hide_short_help(hide)
        }),
        None => command,
    };
    let hidden = command
        .get_arguments()
        .filter(|arg| arg.is_hide_short_help_set());
    let count = hidden.count() + GLOBAL_HIDDEN;
    command
        .after_help(format!("see --help for {count} more options"))
        .after_long_help(long.trim_end().to_owned())
}

/// Number of options of all commands that `-h` hides.
const GLOBAL_HIDDEN: usize = 4;

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::path::PathBuf;

    use super::*;
    use subaperture::terrain::Geoid;

    use crate::args::TrackSource;
    use clap::{Arg, Parser, ValueHint};

    /// Full names of all commands below `command`, groups included.
    fn names(command: &Command, before: &str) -> Vec<String> {
        let each = command.get_subcommands().flat_map(|below| {
            let name = format!("{before} {}", below.get_name());
            let name = name.trim_start().to_owned();
            let more = names(below, &name);
            std::iter::once(name).chain(more)
        });
        each.collect()
    }

    /// Arguments of `command` and of all commands below it, each with the name of its command.
    fn arguments(command: &Command) -> Vec<(String, &Arg)> {
        let name = command.get_name();
        let own = command.get_arguments();
        let own = own.map(|arg| (format!("{name} {}", arg.get_id()), arg));
        own.chain(command.get_subcommands().flat_map(arguments))
            .collect()
    }

    /// Shells complete names of files only where the argument states that it takes a path.
    #[test]
    fn every_path_has_a_hint_for_completions() {
        let paths = [
            TypeId::of::<PathBuf>(),
            TypeId::of::<TrackSource>(),
            TypeId::of::<Geoid>(),
        ];
        let command = Args::command();
        let mut count = 0;
        for (name, arg) in arguments(&command) {
            let values = arg.get_value_parser().type_id();
            let hint = arg.get_value_hint();
            if !paths.iter().any(|path| values == *path) {
                // A value that only contains a path, such as dem:FILE, cannot be completed as one.
                assert_eq!(hint, ValueHint::Unknown, "{name}");
                continue;
            }
            count += 1;
            let value = arg.get_value_names().map_or("", |names| names[0].as_str());
            match value {
                "DIR" => assert_eq!(hint, ValueHint::DirPath, "{name}"),
                "IMAGE" | "REFERENCE" | "OTHER" | "A" | "B" | "PATH" => {
                    assert_eq!(hint, ValueHint::AnyPath, "{name}")
                }
                _ => assert_eq!(hint, ValueHint::FilePath, "{name}"),
            }
        }
        assert!(count > 60, "{count}");
    }

    #[test]
    fn every_command_belongs_to_one_group() {
        for command in Args::command().get_subcommands() {
            let groups = GROUPS
                .iter()
                .filter(|(_, names)| names.contains(&command.get_name()));
            assert_eq!(groups.count(), 1, "{}", command.get_name());
        }
        let all = names(&Args::command(), "");
        for name in GROUPS.iter().flat_map(|(_, names)| names.iter()) {
            let built = all.iter().any(|other| other == name);
            assert!(
                built || ["help", "view"].contains(name),
                "{name} is no command"
            );
        }
    }

    #[test]
    fn every_command_has_examples_that_parse() {
        for name in names(&Args::command(), "") {
            let whole = command();
            let mut words = name.split(' ');
            let found = words.try_fold(&whole, |at, word| at.find_subcommand(word));
            let help = found.and_then(Command::get_after_long_help);
            let help = help.map(ToString::to_string).unwrap_or_default();
            let (_, examples) = help
                .split_once("Example:\n")
                .unwrap_or_else(|| panic!("{name}"));
            for line in examples.lines() {
                let line = line.split(" > ").next().unwrap_or_default();
                let parsed = Args::try_parse_from(line.split_whitespace());
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
            }
        }
    }

    #[test]
    fn tables_name_commands_and_options_that_exist() {
        let all = names(&Args::command(), "");
        let whole = Args::command();
        for (name, _) in EXAMPLES {
            assert!(
                name == "view" || all.iter().any(|other| other == name),
                "{name}"
            );
        }
        for (name, options) in SHORT {
            let mut words = name.split(' ');
            let found = words.try_fold(&whole, |at, word| at.find_subcommand(word));
            let found = found.unwrap_or_else(|| panic!("{name}"));
            assert!(options.len() <= 10, "{name}");
            for option in options {
                let known = found.get_arguments().any(|arg| arg.get_id() == option);
                // The web page is not in every build.
                assert!(known || *option == "page", "{name}: {option}");
            }
        }
    }

    #[test]
    fn as_many_options_of_all_commands_are_hidden_as_counted() {
        let whole = Args::command();
        let hidden = whole
            .get_arguments()
            .filter(|arg| arg.is_hide_short_help_set());
        assert_eq!(hidden.count(), GLOBAL_HIDDEN);
    }
}
