//! Results of every command: the same on standard output with `-q`, and with all written files under `--json`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use subaperture_tests::subap::{listing, root, run};
use tempfile::TempDir;

use crate::every_command::{COMMANDS, workplace};

/// Runs in addition to those of every command: results that only options give.
const MORE: [&str; 7] = [
    "focus few.cphd --grid x=-20:20:0.2,y=-20:20:0.2 --allow-error --product png --place 40,-86 -o map",
    "focus few.cphd --grid x=-20:20:0.2,y=-20:20:0.2 --allow-error --tiled -o tiles",
    "simulate few.toml -o both.cphd --echoes both",
    "autofocus few.cphd --grid x=-20:20:0.2,y=-20:20:0.2 -o p.csv --picture p.png",
    "navigation track.csv -o nav.csv",
    "quality image/image.npy",
    "plan radar raw/recording.toml --plots plots",
];

/// All lines of the table of commands and of [`MORE`].
fn lines() -> Vec<String> {
    let each = COMMANDS.iter().flat_map(|(_, lines)| lines.iter());
    // The budget in names of outputs.
    each.chain(&MORE)
        .map(|line| line.replace('%', "28"))
        .collect()
}

/// A copy of a folder with all inputs.
fn copy(folder: &Path) -> TempDir {
    let copy = tempfile::tempdir().unwrap();
    let copied = Command::new("cp")
        .arg("-r")
        .arg(folder.join("."))
        .arg(copy.path())
        .status();
    assert!(copied.unwrap().success());
    copy
}

/// Words of a result without durations and without the counts that depend on the speed of the machine.
fn lasting(text: &str) -> Vec<String> {
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    // The table of demo has times in its last column, without units.
    let is_timed = text
        .lines()
        .next()
        .is_some_and(|header| header.ends_with(" seconds"));
    let mut kept: Vec<String> = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with("queue ")) {
        for word in line.split_whitespace() {
            let unit = word.trim_end_matches([',', ';', ')']);
            if ["ns", "us", "ms", "s", "min", "h"].contains(&unit) {
                kept.pop_if(|word| is_number(word.trim_start_matches('(')));
                continue;
            }
            kept.push(word.to_owned());
        }
        if is_timed {
            kept.pop_if(|word| is_number(word));
        }
    }
    kept
}

#[test]
fn quiet_changes_standard_error_only() {
    let usual = workplace();
    let quiet = copy(usual.path());
    for line in lines() {
        let [a, b] = [
            run(usual.path(), &line),
            run(quiet.path(), &format!("{line} -q")),
        ];
        assert_eq!(a.code, b.code, "{line}: {a:?} {b:?}");
        assert_eq!(lasting(&a.stdout), lasting(&b.stdout), "{line}");
        if matches!(a.code, Some(0 | 3)) {
            assert!(!a.stdout.is_empty(), "{line}");
        }
        for said in b.stderr.lines() {
            let kinds = ["warning: ", "error: "];
            assert!(
                kinds.iter().any(|kind| said.starts_with(kind)),
                "{line}: {said}"
            );
        }
    }
}

/// Commands that print plain text.
const PLAIN: [&str; 3] = ["completions", "man", "recording"];

/// Files that a run added or changed below `folder`; a store is one path.
fn written(folder: &Path, before: &[(PathBuf, u64, std::time::SystemTime)]) -> BTreeSet<PathBuf> {
    let changed = state(folder)
        .into_iter()
        .filter(|now| !before.contains(now));
    let paths = changed.map(|(path, ..)| path);
    let in_store = |path: PathBuf| {
        let store = path.ancestors().find(|path| {
            let name = path.extension();
            name.is_some_and(|extension| extension == "zarr")
        });
        store.map(Path::to_owned).unwrap_or(path)
    };
    paths.map(in_store).collect()
}

/// Files below `folder` with size and time of modification.
fn state(folder: &Path) -> Vec<(PathBuf, u64, std::time::SystemTime)> {
    let files = listing(folder).into_iter();
    let files = files.filter(|(path, _)| !path.is_dir());
    files
        .map(|(path, bytes)| {
            let time = path.metadata().unwrap().modified().unwrap();
            let name = path.strip_prefix(folder).unwrap().to_owned();
            (name, bytes, time)
        })
        .collect()
}

/// Kinds of files in the guide.
fn explained_kinds() -> BTreeSet<String> {
    let guide = root().join("host/guide/src/reference/output.md");
    let text = std::fs::read_to_string(guide).unwrap();
    let (_, table) = text.split_once("| `kind` | file |\n").unwrap();
    let first_cells = table.lines().filter_map(|row| row.split('|').nth(1));
    let kinds = first_cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    kinds.map(str::to_owned).collect()
}

#[test]
fn json_lists_exactly_the_written_files() {
    let folder = workplace();
    let at = folder.path();
    let (mut writers, mut kinds) = (BTreeSet::new(), BTreeSet::new());
    for line in lines() {
        let name = line.split(' ').next().unwrap().to_owned();
        if PLAIN.contains(&name.as_str()) {
            continue;
        }
        let before = state(at);
        let ran = run(at, &format!("{line} --json"));
        let result: Value = serde_json::from_str(&ran.stdout).unwrap();
        // A self-test with a failed check reports like one that passed.
        let schema = result["schema"].as_str().unwrap();
        if !matches!(ran.code, Some(0 | 3)) && !schema.ends_with("-selftest") {
            assert_eq!(result["schema"], "subaperture-error", "{line}");
            continue;
        }
        let mut written = written(at, &before);
        // The state of a job is for its next run, not a result.
        written.retain(|path| !path.ends_with("job.json"));
        let files = result["files"].as_array().cloned().unwrap_or_default();
        let mut listed = BTreeSet::new();
        for file in &files {
            let mut file = file.clone();
            let kind = file["kind"].as_str().unwrap().to_owned();
            let channels = file.as_object_mut().unwrap().remove("channels");
            if let Some(channels) = channels {
                assert!(
                    ["phase history", "recording"].contains(&kind.as_str()),
                    "{line}"
                );
                for channel in channels.as_array().unwrap() {
                    let keys: Vec<&String> = channel.as_object().unwrap().keys().collect();
                    assert_eq!(keys, ["channel", "pulses", "samples"], "{line}");
                }
            }
            let keys: Vec<&String> = file.as_object().unwrap().keys().collect();
            assert_eq!(keys, ["kind", "path"], "{line}");
            kinds.insert(kind);
            listed.insert(PathBuf::from(file["path"].as_str().unwrap()));
        }
        assert_eq!(listed.len(), files.len(), "{line}: a file is listed twice");
        assert_eq!(listed, written, "{line}");
        if !listed.is_empty() {
            writers.insert(name);
        }
    }
    println!("{writers:?} {kinds:?}");
    let explained = explained_kinds();
    assert!(kinds.is_subset(&explained), "{kinds:?} {explained:?}");
    for name in [
        "focus",
        "velocity",
        "gmti",
        "simulate",
        "tune",
        "track",
        "autofocus",
        "navigation",
        "pair",
        "displacement",
        "quality",
        "picture",
        "capture",
        "live",
        "radio",
        "profile",
        "export",
        "run",
        "plan",
        "reproduce",
    ] {
        assert!(writers.contains(name), "{name} wrote no file");
    }
}
