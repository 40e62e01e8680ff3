//! What of a job is done, kept in its folder.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use subaperture_io::atomic::{WriteError, write_atomically};

use super::basis::Basis;
use super::stamp::{FileStamp, stamp};

/// The state's file in a job's folder.
pub const NAME: &str = "job.json";

const SCHEMA: &str = "subaperture-job";

/// Longest state that is read: thousands of outputs.
const LONGEST_BYTES: u64 = 16 << 20;

/// Changes that are told one by one.
const MOST_TOLD: usize = 4;

/// A finished stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Made {
    /// What it was made by.
    pub basis: Basis,
    /// What it left.
    pub outputs: Vec<FileStamp>,
    /// Time that it took, seconds; of one that was gone on with that of the last run.
    pub seconds: f64,
    /// Whether an earlier run had begun it.
    pub resumed: bool,
    /// What its user has to know.
    pub warnings: Vec<String>,
    /// Whether a bound was missed, and that was allowed.
    pub bound_missed: bool,
}

/// A stage that goes on where it was ended, once it has begun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Begun {
    stage: String,
    fingerprint: String,
}

/// What of a job is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    schema: String,
    schema_version: u32,
    begun: Option<Begun>,
    stages: BTreeMap<String, Made>,
}

/// Why there is no state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// It is none.
    #[error("{}: this is no state of a job that can be read ({what}): move it, and the job is done anew", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
}

/// Why a stage is to be done.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Why {
    /// It never was, or was ended before its end.
    NotDone,
    /// It had begun, by the same basis, and goes on.
    Begun,
    /// By another version of the program.
    Version {
        /// Which.
        was: String,
    },
    /// Other settings.
    Settings(Vec<Change>),
    /// Files that it reads are others.
    Files,
    /// A stage before it was done by something else.
    After(String),
    /// What it left is no more, or not as it was.
    Output(String),
}

/// A setting that is another.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Its key.
    pub key: String,
    /// What it was; `Null` if it was not given.
    pub was: Value,
    /// What it is.
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

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotDone => f.write_str("not done yet"),
            Self::Begun => f.write_str("begun, and goes on"),
            Self::Version { was } => write!(f, "done by version {was}"),
            Self::Settings(changes) => {
                for (i, change) in changes.iter().take(MOST_TOLD).enumerate() {
                    let before = if i == 0 { "" } else { "; " };
                    write!(f, "{before}{change}")?;
                }
                match changes.len().saturating_sub(MOST_TOLD) {
                    0 => Ok(()),
                    more => write!(f, "; and {more} more"),
                }
            }
            Self::Files => f.write_str("files that it reads have changed"),
            Self::After(stage) => write!(f, "follows {stage}, which is another"),
            Self::Output(path) => write!(f, "{path} is not there as it was left"),
        }
    }
}

/// Whether a path leads to something below where it starts.
fn is_within(path: &str) -> bool {
    let mut parts = Path::new(path).components();
    !path.is_empty() && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Settings that differ.
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
    /// That of the job in `folder`; one of nothing done, if there is none.
    ///
    /// # Errors
    /// [`StateError`].
    pub fn read(folder: &Path) -> Result<Self, StateError> {
        let path = folder.join(NAME);
        let read = || {
            if std::fs::metadata(&path)?.len() > LONGEST_BYTES {
                return Err(io::Error::other("more than 16 MiB"));
            }
            std::fs::read(&path)
        };
        match read() {
            Ok(text) => Self::of_text(&text).map_err(|what| StateError::Damaged { path, what }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Self::default()),
            Err(source) => Err(StateError::Io { path, source }),
        }
    }

    /// That which a text says.
    ///
    /// # Errors
    /// In words, what is wrong with it.
    pub fn of_text(text: &[u8]) -> Result<Self, String> {
        let state: Self = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        if state.schema != SCHEMA || state.schema_version != 1 {
            let (schema, version) = (&state.schema, state.schema_version);
            return Err(format!("its schema is {schema} {version}"));
        }
        // What a job removes of its own is never anything else.
        let mut outputs = state.stages.values().flat_map(|made| &made.outputs);
        if let Some(output) = outputs.find(|output| !is_within(&output.path)) {
            return Err(format!("{} is not in the job's folder", output.path));
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

    /// The state as text.
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("a state is JSON") + "\n"
    }

    /// Puts it into `folder`, in place of the one that is there.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let text = self.to_text();
        write_atomically(&folder.join(NAME), text.len() as u64, |file| {
            file.write_all(text.as_bytes())
        })
    }

    /// Why the stage of this basis is to be done; `None` if it stands. `before` are the stages that it goes on from, the nearest first.
    ///
    /// # Errors
    /// If an output cannot be read.
    pub fn why(&self, folder: &Path, basis: &Basis, before: &[&str]) -> io::Result<Option<Why>> {
        let Some(made) = self.stages.get(&basis.stage) else {
            let begun = self.has_begun(&basis.stage, &basis.fingerprint());
            return Ok(Some(if begun { Why::Begun } else { Why::NotDone }));
        };
        if made.basis.fingerprint() != basis.fingerprint() {
            return Ok(Some(differs(&made.basis, basis, before)));
        }
        for output in &made.outputs {
            if stamp(&folder.join(&output.path), &output.path)?.as_ref() != Some(output) {
                return Ok(Some(Why::Output(output.path.clone())));
            }
        }
        Ok(None)
    }

    /// Whether what stage began with this fingerprint was not ended.
    pub fn has_begun(&self, stage: &str, fingerprint: &str) -> bool {
        let begun = self.begun.as_ref();
        begun.is_some_and(|begun| begun.stage == stage && begun.fingerprint == fingerprint)
    }

    /// Whether this stage was ever begun or done.
    pub fn knows(&self, stage: &str) -> bool {
        let begun = self.begun.as_ref();
        self.stages.contains_key(stage) || begun.is_some_and(|begun| begun.stage == stage)
    }

    /// The stage is about to touch its outputs: it is no longer done. To be written before.
    pub fn forget(&mut self, stage: &str) {
        self.stages.remove(stage);
    }

    /// As [`Self::forget`], of a stage that goes on where it is ended.
    pub fn begin(&mut self, stage: &str, fingerprint: &str) {
        self.forget(stage);
        self.begun = Some(Begun {
            stage: stage.to_owned(),
            fingerprint: fingerprint.to_owned(),
        });
    }

    /// The stage is done, and its outputs complete.
    pub fn finish(&mut self, made: Made) {
        let stage = &made.basis.stage;
        if self.begun.as_ref().is_some_and(|b| b.stage == *stage) {
            self.begun = None;
        }
        self.stages.insert(stage.clone(), made);
    }

    /// A finished stage.
    pub fn made(&self, stage: &str) -> Option<&Made> {
        self.stages.get(stage)
    }

    /// Drops stages that the job no longer has; those that were dropped.
    pub fn keep(&mut self, stages: &[&str]) -> Vec<Made> {
        let gone: Vec<String> = self
            .stages
            .keys()
            .filter(|name| !stages.contains(&name.as_str()))
            .cloned()
            .collect();
        gone.iter()
            .filter_map(|name| self.stages.remove(name))
            .collect()
    }
}

/// How what a stage was done by differs from what it is to be done by.
fn differs(was: &Basis, is: &Basis, before: &[&str]) -> Why {
    if was.version != is.version {
        return Why::Version {
            was: was.version.clone(),
        };
    }
    // The stage's own settings say more than that one before it is another.
    let changed = changes(&was.settings, &is.settings);
    if !changed.is_empty() {
        return Why::Settings(changed);
    }
    let known = |files: &[FileStamp]| -> Vec<(u64, String)> {
        files.iter().map(|f| (f.bytes, f.crc32.clone())).collect()
    };
    if known(&was.files) != known(&is.files) {
        return Why::Files;
    }
    let other = |name: &&&str| was.after.get(**name) != is.after.get(**name);
    let name = before.iter().find(other).map(|name| (*name).to_owned());
    Why::After(name.unwrap_or_else(|| "a stage before it".to_owned()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;

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

    fn made(folder: &Path, basis: &Basis, outputs: &[&str]) -> Made {
        Made {
            basis: basis.clone(),
            outputs: outputs
                .iter()
                .map(|name| stamp(&folder.join(name), name).unwrap().unwrap())
                .collect(),
            seconds: 1.5,
            resumed: false,
            warnings: vec!["mind".to_owned()],
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
    fn what_is_done_stands_also_when_it_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, focus, quality) = two(at);
        state.write(at).unwrap();
        let read = State::read(at).unwrap();
        assert_eq!(read, state);
        assert_eq!(read.why(at, &focus, &[]).unwrap(), None);
        assert_eq!(read.why(at, &quality, &["focus"]).unwrap(), None);
        let check = basis("check", json!(0), &[]);
        assert_eq!(read.why(at, &check, &[]).unwrap(), Some(Why::NotDone));
    }

    #[test]
    fn a_change_redoes_its_stage_and_what_follows() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, _, quality) = two(at);
        let focus = basis("focus", json!(2), &[]);
        let why = state.why(at, &focus, &[]).unwrap().unwrap();
        assert_eq!(why.to_string(), "x.key was 1 and is 2");
        let follows = basis("quality", json!("a"), &[("focus", focus.fingerprint())]);
        assert_eq!(
            state.why(at, &follows, &["focus"]).unwrap(),
            Some(Why::After("focus".to_owned()))
        );
        // Its own change says more.
        let both = basis("quality", Value::Null, &[("focus", focus.fingerprint())]);
        let why = state.why(at, &both, &["focus"]).unwrap().unwrap();
        assert_eq!(why.to_string(), "x.key was \"a\" and is not given");
        assert_eq!(state.why(at, &quality, &["focus"]).unwrap(), None);
    }

    #[test]
    fn an_output_that_is_gone_or_another_is_made_again_and_no_more() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (state, focus, quality) = two(at);
        fs::write(at.join("image"), "I").unwrap();
        let output = Some(Why::Output("image".to_owned()));
        assert_eq!(state.why(at, &focus, &[]).unwrap(), output);
        // The same basis makes the same image.
        assert_eq!(state.why(at, &quality, &["focus"]).unwrap(), None);
        fs::remove_file(at.join("image")).unwrap();
        assert_eq!(state.why(at, &focus, &[]).unwrap(), output);
    }

    #[test]
    fn what_was_begun_goes_on_by_the_same_fingerprint_only() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (mut state, focus, _) = two(at);
        let other = basis("focus", json!(3), &[]);
        state.begin("focus", &other.fingerprint());
        assert!(state.knows("focus"));
        assert_eq!(state.why(at, &other, &[]).unwrap(), Some(Why::Begun));
        assert_eq!(state.why(at, &focus, &[]).unwrap(), Some(Why::NotDone));
        state.finish(made(at, &other, &["image"]));
        assert!(!state.has_begun("focus", &other.fingerprint()));
        assert_eq!(state.why(at, &other, &[]).unwrap(), None);
    }

    #[test]
    fn stages_that_are_gone_are_told_with_what_they_left() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let (mut state, ..) = two(at);
        let gone = state.keep(&["focus"]);
        assert_eq!(gone.len(), 1);
        assert_eq!(gone[0].outputs[0].path, "quality");
        assert!(state.made("focus").is_some() && state.made("quality").is_none());
    }

    #[test]
    fn what_is_no_state_says_so() {
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
            assert!(error.contains("no state of a job"), "{text}: {error}");
        }
        // An output is never elsewhere.
        for path in ["/etc/passwd", "../image", "a/../../b", ""] {
            let (mut state, ..) = two(at);
            let mut made = state.made("focus").unwrap().clone();
            made.outputs[0].path = path.to_owned();
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
