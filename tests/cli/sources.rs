//! Rules for sources: image formers are found by their list, with stated exceptions; code that affects an image's bits uses no functions of
//! the platform; no two files import each other, parents and children included.

mod import_cycles;
mod modules;

use std::fs;
use std::path::{Path, PathBuf};

use import_cycles::Imports;
use subaperture::focus::formers::FORMERS;
use subaperture_tests::subap::{root, run};

/// Types of the formers.
const TYPES: [&str; 8] = [
    "Auto",
    "Exact",
    "Backprojection",
    "RangeDopplerBackprojection",
    "FastFactorised",
    "PolarFormat",
    "OmegaK",
    "RangeDopplerAlgorithm",
];

/// Folders that find formers by the list.
const SEARCHED: [&str; 5] = [
    "host/focus/src",
    "host/planner/src",
    "host/subap/src",
    "tests/benches",
    "tests/src/bin/bench",
];

/// Files that name a particular former, and the reason.
const EXCEPTIONS: [(&str, &str); 7] = [
    (
        "host/focus/src/live/mod.rs",
        "a live image is backprojected pulse by pulse",
    ),
    (
        "host/planner/src/radar.rs",
        "the thesis's mode, whose lobes are planned",
    ),
    (
        "host/subap/src/commands/demo/trials.rs",
        "modes of the thesis",
    ),
    (
        "host/subap/src/commands/focus/check.rs",
        "errors are those against the exact sum",
    ),
    (
        "host/subap/src/commands/plan/radar.rs",
        "others are compared with backprojection",
    ),
    (
        "host/subap/src/commands/quality/from.rs",
        "a chip is small and lies anywhere",
    ),
    (
        "host/subap/src/commands/tune/pictures.rs",
        "a picture of any track",
    ),
];

pub(super) fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// Lines of code with their numbers, without comments and without the tests at a file's end.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines());
    lines
        .take_while(|(_, line)| *line != "#[cfg(test)]")
        .filter(|(_, line)| !line.trim_start().starts_with("//"))
}

#[test]
fn formers_are_named_only_in_their_own_folders() {
    let mut used = [false; EXCEPTIONS.len()];
    let mut strays = Vec::new();
    for folder in SEARCHED {
        for path in sources(&root().join(folder)) {
            let name = path.strip_prefix(root()).unwrap();
            if name.starts_with("host/focus/src/formers") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            for (number, line) in code(&text) {
                let mut words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
                let Some(word) = words.find(|word| TYPES.contains(word)) else {
                    continue;
                };
                match EXCEPTIONS
                    .iter()
                    .position(|(place, _)| name.starts_with(place))
                {
                    Some(exception) => used[exception] = true,
                    None => strays.push(format!("{}:{number}: {word}", name.display())),
                }
            }
        }
    }
    assert!(strays.is_empty(), "{strays:#?}");
    for ((place, why), used) in EXCEPTIONS.iter().zip(used) {
        assert!(used, "no exception is needed for {place}: {why}");
    }
}

/// The oracle of the tests shares no code with the library: it names only `std`, and includes no file.
#[test]
fn plain_sum_uses_only_std() {
    let text = fs::read_to_string(root().join("tests/src/plain_sum.rs")).unwrap();
    let imported = |line: &str| {
        let line = line.trim_start();
        ["use ", "pub use ", "mod ", "pub mod ", "extern "]
            .iter()
            .any(|start| line.starts_with(start))
    };
    let imports: Vec<&str> = code(&text)
        .map(|(_, line)| line)
        .filter(|line| imported(line))
        .collect();
    assert!(!imports.is_empty());
    for line in imports {
        assert!(line.starts_with("use std::"), "{line}");
    }
    for (number, line) in code(&text) {
        for other in ["crate::", "super::", "subaperture", "glam", "include"] {
            assert!(!line.contains(other), "line {number}: {line}");
        }
        // A path from the root of another crate.
        assert!(!line.contains(" ::"), "line {number}: {line}");
    }
}

/// The folder of a former names no type of another former, and only the list names the folders.
#[test]
fn formers_are_independent_of_each_other() {
    let formers = root().join("host/focus/src/formers");
    let list = fs::read_to_string(formers.join("mod.rs")).unwrap();
    let folders: Vec<String> = fs::read_dir(&formers)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(folders.len(), FORMERS.len());
    for folder in &folders {
        let listed =
            |line: &str| line.starts_with(&format!("    {folder}::")) && line.ends_with("::ENTRY,");
        assert!(list.lines().any(listed), "{folder} is not in the list");
        for path in sources(&formers.join(folder)) {
            let text = fs::read_to_string(&path).unwrap();
            for other in folders.iter().filter(|other| *other != folder) {
                for (number, line) in code(&text) {
                    // The sum over a pulse, which formers may share with the exact former.
                    let is_shared =
                        line.contains("exact::add_pulse") || line.contains("exact::{LANES");
                    let names =
                        ["super", "crate", "formers"].map(|from| format!("{from}::{other}::"));
                    let names = names.iter().any(|name| line.contains(name));
                    assert!(!names || is_shared, "{}:{number}: {line}", path.display());
                }
            }
        }
    }
}

/// Files of the library with words that look like options, and their meaning.
const LIKE_OPTIONS: [(&str, &str); 6] = [
    ("host/gallery/src/page.rs", "a style sheet's variables"),
    (
        "host/io/src/recording/mod.rs",
        "where a setting comes from, as its faults name it",
    ),
    (
        "host/radio/src/experiment/keys.rs",
        "where a setting comes from, as its faults name it",
    ),
    (
        "host/simulate/src/scenario/mod.rs",
        "where a setting comes from, as its faults name it",
    ),
    (
        "host/radio/src/uhd/errors.rs",
        "parameters of a new device for the system",
    ),
    (
        "host/radio/src/uhd/ffi/tests.rs",
        "whether there is a compiler",
    ),
];

/// Assert that lines of code for which `is_like` holds occur in exactly the files of `known`, among `sources`. Returns the number of
/// sources.
fn assert_only_in(
    sources: impl Iterator<Item = PathBuf>,
    is_like: impl Fn(&str) -> bool,
    known: &[(&str, &str)],
) -> usize {
    let mut used = vec![false; known.len()];
    let mut strays = Vec::new();
    let mut searched = 0;
    for path in sources {
        let name = path.strip_prefix(root()).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        searched += 1;
        for (number, line) in code(&text).filter(|(_, line)| is_like(line)) {
            match known.iter().position(|(place, _)| name == Path::new(place)) {
                Some(known) => used[known] = true,
                None => strays.push(format!("{}:{number}: {line}", name.display())),
            }
        }
    }
    assert!(strays.is_empty(), "{strays:#?}");
    assert!(used.iter().all(|used| *used), "{known:?}: {used:?}");
    searched
}

/// Errors of the library state fault and remedy; the command adds the option that applies the remedy (`host/subap/src/advice.rs`).
#[test]
fn only_the_command_names_options() {
    let library = sources(&root().join("host")).into_iter().filter(|path| {
        let name = path.strip_prefix(root()).unwrap();
        !name.starts_with("host/subap") && name.iter().any(|part| part == "src")
    });
    let is_like = |line: &str| {
        // `--` followed by a letter is not an operator of the language.
        let mut parts = line.split("--").skip(1);
        parts.any(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()))
    };
    let searched = assert_only_in(library, is_like, &LIKE_OPTIONS);
    assert!(searched > 200, "{searched}");
}

/// Packages that affect the bits of an image.
const AFFECTING_BITS: [&str; 8] = [
    "fft", "signal", "kernels", "model", "describe", "io", "simulate", "focus",
];

/// Functions of the platform's library, whose last bits differ between platforms; those of `libm` are the same everywhere.
const OF_THE_PLATFORM: [&str; 25] = [
    ".sin()",
    ".cos()",
    ".tan()",
    ".sin_cos()",
    ".asin()",
    ".acos()",
    ".atan()",
    ".atan2(",
    ".sinh()",
    ".cosh()",
    ".tanh()",
    ".asinh()",
    ".acosh()",
    ".exp()",
    ".exp2()",
    ".ln()",
    ".ln_1p()",
    ".log2()",
    ".log10()",
    ".powf(",
    ".cbrt()",
    ".hypot(",
    ".arg()",
    "::cis(",
    "::from_polar(",
];

/// Files that may use them, because no pixel depends on the result.
const NOT_AFFECTING_BITS: [(&str, &str); 4] = [
    ("host/focus/src/live/mod.rs", "printed errors"),
    ("host/io/src/product/record.rs", "statistics in a record"),
    ("host/model/src/image/comparison.rs", "measures of images"),
    (
        "host/model/src/resolution/theory.rs",
        "measures of responses",
    ),
];

/// Images by portable transforms have the same bits on every machine, and so have all plans.
#[test]
fn code_that_affects_bits_uses_no_platform_functions() {
    // Files of tests.
    const OF_TESTS: [&str; 3] = ["counted.rs", "tests.rs", "trial.rs"];
    let bearing = AFFECTING_BITS
        .iter()
        .flat_map(|package| sources(&root().join("host").join(package).join("src")))
        .filter(|path| !OF_TESTS.iter().any(|test| path.ends_with(test)));
    let is_like = |line: &str| OF_THE_PLATFORM.iter().any(|word| line.contains(word));
    let searched = assert_only_in(bearing, is_like, &NOT_AFFECTING_BITS);
    assert!(searched > 150, "{searched}");
}

/// Imports between files of a crate have one direction, as those between crates. A parent imports its children, or they import it.
#[test]
fn files_have_no_circular_imports() {
    let hosts = fs::read_dir(root().join("host")).unwrap();
    let hosts = hosts.map(|entry| entry.unwrap().path());
    let crates = hosts.chain(["core", "firmware"].map(|name| root().join(name)));
    let mut found = String::new();
    let mut searched = 0;
    for folder in crates.map(|folder| folder.join("src")) {
        let files: Vec<(String, String)> = sources(&folder)
            .into_iter()
            .map(|path| {
                let name = path.strip_prefix(&folder).unwrap();
                let text = fs::read_to_string(&path).unwrap();
                (name.to_str().unwrap().to_owned(), text)
            })
            .collect();
        searched += files.len();
        let place = folder.strip_prefix(root()).unwrap().display().to_string();
        for cycle in Imports::of(&files).cycles() {
            found += &format!("\nin {place}:\n    {}", cycle.join("\n    "));
        }
    }
    assert!(
        found.is_empty(),
        "these files import each other; move the shared items to a file below them:{found}"
    );
    assert!(searched > 300, "{searched}");
}

/// Every option of the list exists, with its help and completion.
#[test]
fn listed_commands_exist() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["focus", "plan focus"] {
        let ran = run(folder.path(), &format!("{command} --help"));
        let words: Vec<&str> = ran.succeeded().split_whitespace().collect();
        let help = words.join(" ");
        for entry in &FORMERS {
            let listed = format!("{}: {}", entry.name, entry.summary);
            assert!(help.contains(&listed), "{command}: no '{listed}'");
            for option in entry.options {
                let typed = format!("--{}", option.name.replace('_', "-"));
                assert!(help.contains(&typed), "{command}: no {typed}");
                assert!(
                    help.contains(option.summary),
                    "{command}: no '{}'",
                    option.summary
                );
            }
        }
        assert!(
            help.contains("Pulses per sub-CPI (rdbp only) [default: largest length"),
            "{help}"
        );
        assert!(
            help.contains(
                "a larger predicted error (all but exact) [default: -60; rdbp: -60, none"
            ),
            "{help}"
        );
    }
    let ran = run(folder.path(), "completions bash");
    let script = ran.succeeded();
    for part in ["--sub-cpi", "--no-keystone", "omega-k", "thesis"] {
        assert!(script.contains(part), "{part}");
    }
}

/// An option of one former is refused with every other one.
#[test]
fn options_of_other_formers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut tried = 0;
    for entry in &FORMERS {
        for option in FORMERS.iter().flat_map(|other| other.options) {
            if entry.option(option.name).is_some() {
                continue;
            }
            let typed = format!("--{}", option.name.replace('_', "-"));
            let value = match option.takes {
                subaperture::focus::formers::OptionType::Switch(_) => String::new(),
                subaperture::focus::formers::OptionType::Word(words) => words[0].name.to_owned(),
                subaperture::focus::formers::OptionType::Bound => "-50".to_owned(),
                _ => "3".to_owned(),
            };
            let line = format!("focus a.mat --out d -a {} {typed} {value}", entry.name);
            let expected = format!(
                "{typed} has no effect with --algorithm {}: leave it out",
                entry.name
            );
            run(folder.path(), &line).failed(2, &[&expected]);
            tried += 1;
        }
    }
    assert!(tried > 20, "{tried}");
}
