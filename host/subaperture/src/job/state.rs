//! State of a job: its finished stages, stored in its folder.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use subaperture_io::atomic::{WriteError, write_atomically};
use subaperture_io::input::open_file;
use subaperture_io::json::{self, JsonError, Limits};

use super::basis::Basis;
use super::output::StageOutput;
use super::stamp::FileStamp;

/// File name of the state in a job's folder.
pub const NAME: &str = "job.json";

const SCHEMA: &str = "subaperture-job";

/// Bounds on a state that is read; sufficient for thousands of outputs.
const LIMITS: Limits = Limits {
    bytes: 4 << 20,
    string_bytes: 1 << 20,
    value_bytes: 8 << 20,
};

/// Maximum number of changes listed individually.
const MAX_LISTED: usize = 4;

/// Finished stage of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinishedStage {
    /// Dependencies with which the stage ran.
    pub basis: Basis,
    /// Output files with their kinds.
    pub outputs: Vec<StageOutput>,
    /// Processing time, seconds; for a resumed stage that of its last run.
    pub seconds: f64,
    /// Whether the stage resumed an earlier run.
    pub resumed: bool,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Whether the result exceeds an error bound, as the settings allow.
    pub bound_missed: bool,
}

/// Begun stage that can resume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Begun {
    stage: String,
    fingerprint: String,
}

/// Finished and begun stages of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    schema: String,
    schema_version: u32,
    begun: Option<Begun>,
    stages: BTreeMap<String, FinishedStage>,
}

/// Error of reading a state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Path of the state file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is not a valid state.
    #[error("{}: not a valid state of a job ({what}): move or remove it to run all stages again", path.display())]
    Damaged {
        /// Path of the state file.
        path: PathBuf,
        /// Reason why the state is invalid.
        what: String,
    },
}

/// Reason for running a stage.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RunReason {
    /// The stage has not run, or was interrupted.
    NotDone,
    /// The stage was begun with the same basis, and resumes.
    Begun,
    /// The stage was run by another version of the program.
    Version {
        /// Version that ran the stage.
        was: String,
    },
    /// The settings of the stage changed.
    Settings(Vec<Change>),
    /// Input files changed.
    Files,
    /// A preceding stage changed.
    After(String),
    /// Outputs are missing or changed.
    Output(String),
}

/// Changed value of a setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Key of the setting.
    pub key: String,
    /// Former value; `Null` if not set.
    pub was: Value,
    /// Present value; `Null` if not set.
    pub is: Value,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |value: &Value| match value {
            Value::Null => "not given".to_owned(),
            value => value.to_string(),
        };
        let (key, was, is) = (&self.key, words(&self.was), words(&self.is));
        write!(f, "{key} was {was} and is {is}")
    }
}

impl fmt::Display for RunReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotDone => f.write_str("not run yet"),
            Self::Begun => f.write_str("interrupted, resumes"),
            Self::Version { was } => write!(f, "run by version {was}"),
            Self::Settings(changes) => {
                for (i, change) in changes.iter().take(MAX_LISTED).enumerate() {
                    let before = if i == 0 { "" } else { "; " };
                    write!(f, "{before}{change}")?;
                }
                match changes.len().saturating_sub(MAX_LISTED) {
                    0 => Ok(()),
                    more => write!(f, "; and {more} more"),
                }
            }
            Self::Files => f.write_str("input files have changed"),
            Self::After(stage) => write!(f, "{stage} has changed"),
            Self::Output(path) => write!(f, "{path} is missing or has changed"),
        }
    }
}

/// Whether a relative path stays below its starting folder.
fn is_within(path: &str) -> bool {
    let mut parts = Path::new(path).components();
    !path.is_empty() && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Changed settings between two bases.
fn changes(was: &Map<String, Value>, is: &Map<String, Value>) -> Vec<Change> {
    let mut keys: Vec<&String> = was.keys().chain(is.keys()).collect();
    keys.sort();
    keys.dedup();
    let of = |settings: &Map<String, Value>, key: &str| {
        settings.get(key).cloned().unwrap_or(Value::Null)
    };
    let differing = keys
        .into_iter()
        .filter(|key| of(was, key) != of(is, key))
        .map(|key| Change {
            key: key.clone(),
            was: of(was, key),
            is: of(is, key),
        });
    differing.collect()
}

impl Default for State {
    fn default() -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            schema_version: 1,
            begun: None,
            stages: BTreeMap::new(),
        }
    }
}

impl State {
    /// Read the state of the job in `folder`. Without a state file the state is empty.
    ///
    /// # Errors
    /// [`StateError`].
    pub fn read(folder: &Path) -> Result<Self, StateError> {
        let path = folder.join(NAME);
        let read = || {
            let file = open_file(&path).map_err(JsonError::Io)?;
            json::value(file, LIMITS)
        };
        match read() {
            Ok(value) => Self::of_value(value).map_err(|what| StateError::Damaged { path, what }),
            Err(JsonError::Io(error)) if error.kind() == io::ErrorKind::NotFound => {
                Ok(Self::default())
            }
            Err(JsonError::Io(source)) => Err(StateError::Io { path, source }),
            Err(error) => Err(StateError::Damaged {
                path,
                what: error.to_string(),
            }),
        }
    }

    /// Parse a state.
    ///
    /// # Errors
    /// The reason why the text is not a valid state.
    pub fn of_text(text: &[u8]) -> Result<Self, String> {
        Self::of_value(json::value(text, LIMITS).map_err(|error| error.to_string())?)
    }

    fn of_value(value: Value) -> Result<Self, String> {
        let state: Self = serde_json::from_value(value).map_err(|error| error.to_string())?;
        if state.schema != SCHEMA || state.schema_version != 1 {
            let (schema, version) = (&state.schema, state.schema_version);
            return Err(format!("its schema is {schema} {version}"));
        }
        // A job deletes only its own outputs, which lie below its folder.
        let mut outputs = state.stages.values().flat_map(|made| &made.outputs);
        if let Some(output) = outputs.find(|output| !is_within(&output.stamp.path)) {
            return Err(format!("{} is not in the job's folder", output.stamp.path));
        }
        if let Some((name, made)) = state
            .stages
            .iter()
            .find(|(n, made)| made.basis.stage != **n)
        {
            return Err(format!("{name} is {}", made.basis.stage));
        }
        Ok(state)
    }

    /// State as JSON text.
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("a state is JSON") + "\n"
    }

    /// Write the state into `folder`, replacing the present one.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let text = self.to_text();
        write_atomically(&folder.join(NAME), text.len() as u64, |file| {
            file.write_all(text.as_bytes())
        })
    }

    /// Reason for running the stage of this basis; `None` if it is up to date. `before` lists the preceding stages, the nearest first.
    ///
    /// # Errors
    /// An output cannot be read.
    pub fn why(
        &self,
        folder: &Path,
        basis: &Basis,
        before: &[&str],
    ) -> io::Result<Option<RunReason>> {
        let Some(made) = self.stages.get(&basis.stage) else {
            let begun = self.has_begun(&basis.stage, &basis.fingerprint());
            return Ok(Some(if begun {
                RunReason::Begun
            } else {
                RunReason::NotDone
            }));
        };
        if made.basis.fingerprint() != basis.fingerprint() {
            return Ok(Some(differs(&made.basis, basis, before)));
        }
        for output in &made.outputs {
            if !output.is_unchanged(folder)? {
                return Ok(Some(RunReason::Output(output.stamp.path.clone())));
            }
        }
        Ok(None)
    }

    /// Whether the stage was begun with this fingerprint and not finished.
    pub fn has_begun(&self, stage: &str, fingerprint: &str) -> bool {
        let begun = self.begun.as_ref();
        begun.is_some_and(|begun| begun.stage == stage && begun.fingerprint == fingerprint)
    }

    /// Whether the stage was ever begun or finished.
    pub fn knows(&self, stage: &str) -> bool {
        let begun = self.begun.as_ref();
        self.stages.contains_key(stage) || begun.is_some_and(|begun| begun.stage == stage)
    }

    /// Remove the entry of a stage. Write the state before the stage modifies its outputs.
    pub fn forget(&mut self, stage: &str) {
        self.stages.remove(stage);
    }

    /// As [`Self::forget`], for a stage that can resume.
    pub fn begin(&mut self, stage: &str, fingerprint: &str) {
        self.forget(stage);
        self.begun = Some(Begun {
            stage: stage.to_owned(),
            fingerprint: fingerprint.to_owned(),
        });
    }

    /// Record a finished stage with its complete outputs.
    pub fn finish(&mut self, made: FinishedStage) {
        let stage = &made.basis.stage;
        if self.begun.as_ref().is_some_and(|b| b.stage == *stage) {
            self.begun = None;
        }
        self.stages.insert(stage.clone(), made);
    }

    /// Entry of a finished stage.
    pub fn made(&self, stage: &str) -> Option<&FinishedStage> {
        self.stages.get(stage)
    }

    /// Remove stages that the job no longer has, and return them.
    pub fn keep(&mut self, stages: &[&str]) -> Vec<FinishedStage> {
        let removed: Vec<String> = self
            .stages
            .keys()
            .filter(|name| !stages.contains(&name.as_str()))
            .cloned()
            .collect();
        removed
            .iter()
            .filter_map(|name| self.stages.remove(name))
            .collect()
    }
}

/// First difference between the basis of a finished stage and the present one.
fn differs(was: &Basis, is: &Basis, before: &[&str]) -> RunReason {
    if was.version != is.version {
        return RunReason::Version {
            was: was.version.clone(),
        };
    }
    // Changes of the stage's own settings are more specific than a changed predecessor.
    let changed = changes(&was.settings, &is.settings);
    if !changed.is_empty() {
        return RunReason::Settings(changed);
    }
    let contents = |files: &[FileStamp]| -> Vec<(u64, String)> {
        files.iter().map(|f| (f.bytes, f.crc32.clone())).collect()
    };
    if contents(&was.files) != contents(&is.files) {
        return RunReason::Files;
    }
    let other = |name: &&&str| was.after.get(**name) != is.after.get(**name);
    let name = before.iter().find(other).map(|name| (*name).to_owned());
    RunReason::After(name.unwrap_or_else(|| "a stage before it".to_owned()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;
    use subaperture_io::written::{FileKind, WrittenFile};

    use super::*;

    fn basis(stage: &str, setting: Value, after: &[(&str, String)]) -> Basis {
        Basis {
            version: "1".to_owned(),
            stage: stage.to_owned(),
            settings: Map::from_iter([("x.key".to_owned(), setting)]),
            files: Vec::new(),
            after: after
                .iter()
                .map(|(name, print)| ((*name).to_owned(), print.clone()))
                .collect(),
        }
    }

    fn made(folder: &Path, basis: &Basis, outputs: &[&str]) -> FinishedStage {
        FinishedStage {
            basis: basis.clone(),
            outputs: outputs
                .iter()
                .map(|name| {
                    let file = WrittenFile::new(folder.join(name), FileKind::Image);
                    StageOutput::of(&file, folder).unwrap().unwrap()
                })
                .collect(),
            seconds: 1.5,
            resumed: false,
            warnings: vec!["a warning".to_owned()],
            bound_missed: false,
        }
    }

    /// A chain of two stages, both done.
    fn two(folder: &Path) -> (State, Basis, Basis) {
        fs::write(folder.join("image"), "i").unwrap();
        fs::write(folder.join("quality"), "q").unwrap();
        let focus = basis("focus", json!(1), &[]);
        let quality = basis("quality", json!("a"), &[("focus", focus.fingerprint())]);
        let mut state = State::default();
        state.finish(made(folder, &focus, &["image"]));
        state.finish(made(folder, &quality, &["quality"]));
        (state, focus, quality)
    }

    #[test]
    fn finished_stages_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, focus, quality) = two(at);
        state.write(at).unwrap();
        let read = State::read(at).unwrap();
        assert_eq!(read, state);
        assert_eq!(read.why(at, &focus, &[]).unwrap(), None);
        assert_eq!(read.why(at, &quality, &["focus"]).unwrap(), None);
        let check = basis("check", json!(0), &[]);
        assert_eq!(read.why(at, &check, &[]).unwrap(), Some(RunReason::NotDone));
    }

    #[test]
    fn changed_stage_and_its_successors_run_again() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, _, quality) = two(at);
        let focus = basis("focus", json!(2), &[]);
        let why = state.why(at, &focus, &[]).unwrap().unwrap();
        assert_eq!(why.to_string(), "x.key was 1 and is 2");
        let follows = basis("quality", json!("a"), &[("focus", focus.fingerprint())]);
        assert_eq!(
            state.why(at, &follows, &["focus"]).unwrap(),
            Some(RunReason::After("focus".to_owned()))
        );
        // A change of its own settings is more specific.
        let both = basis("quality", Value::Null, &[("focus", focus.fingerprint())]);
        let why = state.why(at, &both, &["focus"]).unwrap().unwrap();
        assert_eq!(why.to_string(), "x.key was \"a\" and is not given");
        assert_eq!(state.why(at, &quality, &["focus"]).unwrap(), None);
    }

    #[test]
    fn missing_or_changed_output_reruns_its_stage_only() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, focus, quality) = two(at);
        fs::write(at.join("image"), "I").unwrap();
        let output = Some(RunReason::Output("image".to_owned()));
        assert_eq!(state.why(at, &focus, &[]).unwrap(), output);
        // Stages after it depend on its basis, which is unchanged.
        assert_eq!(state.why(at, &quality, &["focus"]).unwrap(), None);
        fs::remove_file(at.join("image")).unwrap();
        assert_eq!(state.why(at, &focus, &[]).unwrap(), output);
    }

    #[test]
    fn begun_stage_resumes_only_with_the_same_fingerprint() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (mut state, focus, _) = two(at);
        let other = basis("focus", json!(3), &[]);
        state.begin("focus", &other.fingerprint());
        assert!(state.knows("focus"));
        assert_eq!(state.why(at, &other, &[]).unwrap(), Some(RunReason::Begun));
        assert_eq!(
            state.why(at, &focus, &[]).unwrap(),
            Some(RunReason::NotDone)
        );
        state.finish(made(at, &other, &["image"]));
        assert!(!state.has_begun("focus", &other.fingerprint()));
        assert_eq!(state.why(at, &other, &[]).unwrap(), None);
    }

    #[test]
    fn removed_stages_are_listed_with_their_outputs() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (mut state, ..) = two(at);
        let removed = state.keep(&["focus"]);
        assert_eq!(removed.len(), 1);
        assert_eq!(removed[0].outputs[0].stamp.path, "quality");
        assert!(state.made("focus").is_some() && state.made("quality").is_none());
    }

    #[test]
    fn invalid_state_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        assert_eq!(State::read(at).unwrap(), State::default());
        for text in [
            "",
            "{",
            "[]",
            "{\"schema\":\"subaperture-job\"}",
            "{\"schema\":\"subaperture-job\",\"schema_version\":9,\"begun\":null,\"stages\":{}}",
        ] {
            fs::write(at.join(NAME), text).unwrap();
            let error = State::read(at).unwrap_err().to_string();
            assert!(
                error.contains("not a valid state of a job"),
                "{text}: {error}"
            );
        }
        // Outputs lie in the job's folder.
        for path in ["/etc/passwd", "../image", "a/../../b", ""] {
            let (mut state, ..) = two(at);
            let mut made = state.made("focus").unwrap().clone();
            made.outputs[0].stamp.path = path.to_owned();
            state.finish(made);
            assert!(
                State::of_text(state.to_text().as_bytes()).is_err(),
                "{path}"
            );
        }
        fs::remove_file(at.join(NAME)).unwrap();
        fs::create_dir(at.join(NAME)).unwrap();
        assert!(matches!(State::read(at), Err(StateError::Io { .. })));
    }
}
