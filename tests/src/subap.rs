//! Runs of the command `subap`.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

pub use subaperture_xtask::root;

/// The program, built on first use with the profile of the tests.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| built(&["--bin", "subap"]))
}

/// An example of the library, built in the same way.
pub fn example(name: &str) -> PathBuf {
    built(&["--example", name])
}

fn built(selection: &[&str]) -> PathBuf {
    let mut cargo = subaperture_xtask::cargo();
    cargo
        .args([
            // The packages of the tests: another selection would enable other features of dependencies, and build all of them again.
            "build",
            "--quiet",
            "--workspace",
            "--exclude",
            "subaperture-firmware",
        ])
        .args(selection)
        .args(["--message-format", "json-render-diagnostics"])
        .stderr(Stdio::inherit());
    // The dev profile has debug assertions, and the release profile has not.
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    let output = cargo.output().expect("cargo starts");
    assert!(output.status.success(), "{selection:?} does not build");
    String::from_utf8(output.stdout)
        .expect("cargo prints UTF-8")
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .expect("cargo names the executable")
}

/// Output and exit status of a run of `subap`.
#[derive(Debug)]
pub struct Ran {
    /// Exit status; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Text written to standard output.
    pub stdout: String,
    /// Text written to standard error.
    pub stderr: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self {
            code: output.status.code(),
            stdout: text(&output.stdout),
            stderr: text(&output.stderr),
        }
    }
}

impl Ran {
    /// Standard output of a run that must have succeeded.
    #[track_caller]
    pub fn succeeded(&self) -> &str {
        assert_eq!(self.code, Some(0), "{self:?}");
        &self.stdout
    }

    /// Whether it printed no error and no warning. Progress, which appears on slow machines, is ignored.
    pub fn is_untroubled(&self) -> bool {
        let begins = |line: &str| line.starts_with("error:") || line.starts_with("warning:");
        !self.stderr.lines().any(begins)
    }

    /// Assert that standard error contains `part`.
    #[track_caller]
    pub fn reports(&self, part: &str) {
        let stderr = &self.stderr;
        assert!(stderr.contains(part), "no '{part}' in: {stderr}");
    }

    /// Assert exit status `code` and a message that contains each of `parts`, without panic, backtrace or `Debug` output.
    #[track_caller]
    pub fn failed(&self, code: i32, parts: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        for part in parts {
            self.reports(part);
        }
        for sign in [
            "panicked",
            "backtrace",
            "RUST_BACKTRACE",
            "Error {",
            "Malformed",
            "Os {",
        ] {
            assert!(!self.stderr.contains(sign), "'{sign}' in: {}", self.stderr);
        }
    }
}

/// A command line of `subap`, to be run in `folder`.
pub fn command<A: AsRef<OsStr>>(folder: &Path, arguments: impl IntoIterator<Item = A>) -> Command {
    let mut command = Command::new(program());
    // A backtrace in the output is a fault even if the developer enables backtraces.
    command
        .args(arguments)
        .current_dir(folder)
        .env("RUST_BACKTRACE", "1")
        .stdin(Stdio::null());
    command
}

/// Runs `subap` in `folder` with the words of `line`.
pub fn run(folder: &Path, line: &str) -> Ran {
    let output = command(folder, line.split_whitespace()).output();
    output.expect("subap starts").into()
}

/// Write a scenario and simulate its recording: `NAME.toml` and `NAME.cphd` in `folder`.
#[track_caller]
pub fn write_recording(folder: &Path, name: &str, scenario: impl AsRef<[u8]>) {
    std::fs::write(folder.join(format!("{name}.toml")), scenario).expect("a scenario is written");
    run(folder, &format!("simulate {name}.toml -o {name}.cphd")).succeeded();
}

/// Temporary folder with a scenario and its recording, as [`write_recording`] writes them.
#[track_caller]
pub fn folder_with_recording(name: &str, scenario: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_recording(folder.path(), name, scenario);
    folder
}

/// Write the example experiment of Chim 2018 into `folder`: `thesis.toml`, and its scene `scene.toml`.
#[track_caller]
pub fn write_thesis_experiment(folder: &Path) {
    for (name, file) in [("thesis", "thesis.toml"), ("thesis-scene", "scene.toml")] {
        let example = run(folder, &format!("capture --example {name}"));
        std::fs::write(folder.join(file), example.succeeded()).expect("an example is written");
    }
}

/// Every file and folder under `folder` with its size, to detect changes.
pub fn listing(folder: &Path) -> BTreeMap<PathBuf, u64> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder that can be read") {
            let path = entry.expect("an entry").path();
            let about = match path.symlink_metadata() {
                // Renamed or removed by another process after the folder was read.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                about => about.expect("metadata"),
            };
            if about.is_dir() {
                folders.push(path.clone());
            }
            found.insert(path, if about.is_dir() { 0 } else { about.len() });
        }
    }
    found
}
