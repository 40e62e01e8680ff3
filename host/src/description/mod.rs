//! Texts that describe something, a scenario or a recording: TOML whose quantities carry their units.
//!
//! Everything is checked against one table of keys (`schema`), which can be printed. Errors point at file,
//! line and column, show the line, and say what to do; several are told at once.
//!
//! ```text
//! text ─> tree (values and places; settings laid over) ─> resolve (names, kinds, units, bounds,
//!         defaults) ─> values, for builders to take
//! ```
//!
//! A setting overrides one key of the text, as `radar.pri` or `scene.point[0].position`; its errors name it in place
//! of a line.

pub(crate) mod error;
mod nearest;
mod reference;
mod resolve;
pub(crate) mod schema;
mod tree;
pub(crate) mod units;
pub(crate) mod values;

use std::io;
use std::path::{Path, PathBuf};

use error::{At, Found, explain};
use schema::Schema;
use tree::{Step, lay_over, parse_path, parse_setting};
use values::Values;

pub use error::{DescriptionError, Fault};

/// Longest text that is read, bytes: far longer than anyone writes.
const LONGEST_BYTES: u64 = 16 << 20;

/// A text and the settings that override it.
#[derive(Clone, Debug)]
pub(crate) struct Description {
    file: String,
    text: String,
    folder: PathBuf,
    settings: Vec<Setting>,
}

#[derive(Clone, Debug)]
struct Setting {
    path: Vec<Step>,
    value: String,
    /// `KEY=VALUE`, for errors.
    words: String,
}

impl Description {
    /// `file` names the text in errors; paths in it start at `folder`.
    pub(crate) fn new(
        file: impl Into<String>,
        text: impl Into<String>,
        folder: impl Into<PathBuf>,
    ) -> Self {
        Self {
            file: file.into(),
            text: text.into(),
            folder: folder.into(),
            settings: Vec::new(),
        }
    }

    /// Reads a text.
    ///
    /// # Errors
    /// If the file cannot be read, is no UTF-8, or has more than 16 MiB.
    pub(crate) fn read(path: &Path) -> io::Result<Self> {
        if std::fs::metadata(path)?.len() > LONGEST_BYTES {
            return Err(io::Error::other(
                "more than 16 MiB: is this a scenario or a recording's description?",
            ));
        }
        let text = std::fs::read_to_string(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Self::new(path.display().to_string(), text, folder))
    }

    /// Where paths in the text start.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Overrides the key at a dotted path. Later settings override earlier ones.
    ///
    /// # Errors
    /// For a key that there is not; values are checked by [`Self::resolve`].
    pub(crate) fn set(
        &mut self,
        schema: &Schema,
        key: &str,
        value: &str,
    ) -> Result<(), DescriptionError> {
        let words = format!("{key}={value}");
        let path = parse_path(key).and_then(|path| {
            known(schema, &path)?;
            Ok(path)
        });
        match path {
            Ok(path) => {
                self.settings.push(Setting {
                    path,
                    value: value.to_owned(),
                    words,
                });
                Ok(())
            }
            Err(message) => {
                let found = Found::new(&At::Setting(0), message);
                Err(explain(&self.file, &self.text, &[words], vec![found]))
            }
        }
    }

    /// The values of the text with the settings laid over.
    ///
    /// # Errors
    /// Everything that is wrong, for [`Self::explain`].
    pub(crate) fn resolve(&self, schema: &Schema) -> Result<Values, Vec<Found>> {
        let mut tree = tree::parse(&self.text).map_err(|found| vec![found])?;
        for (index, setting) in self.settings.iter().enumerate() {
            let value = parse_setting(&setting.value, index);
            lay_over(&mut tree, &setting.path, value).map_err(|found| vec![found])?;
        }
        let mut faults = Vec::new();
        let top = resolve::resolve(
            schema,
            schema.sections[0],
            &tree,
            &At::Text(0..0),
            &mut faults,
        );
        if faults.is_empty() {
            Ok(top)
        } else {
            Err(faults)
        }
    }

    /// Puts what is wrong into words, with its lines.
    pub(crate) fn explain(&self, faults: Vec<Found>) -> DescriptionError {
        let words: Vec<String> = self.settings.iter().map(|s| s.words.clone()).collect();
        explain(&self.file, &self.text, &words, faults)
    }
}

/// Files that the description at `path` names: every text in it that is the path of one, whatever its key. Errors are for
/// who reads it.
pub(crate) fn named_files(path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let whole = std::fs::metadata(path).is_ok_and(|about| about.len() <= LONGEST_BYTES);
    let text = if whole {
        std::fs::read_to_string(path).unwrap_or_default()
    } else {
        String::new()
    };
    let mut values: Vec<toml::Value> = match text.parse::<toml::Table>() {
        Ok(table) => table.into_iter().map(|(_, value)| value).collect(),
        Err(_) => Vec::new(),
    };
    let mut files = Vec::new();
    while let Some(value) = values.pop() {
        match value {
            toml::Value::String(text) => {
                let file = folder.join(text);
                if file.is_file() {
                    files.push(file);
                }
            }
            toml::Value::Array(list) => values.extend(list),
            toml::Value::Table(table) => values.extend(table.into_iter().map(|(_, value)| value)),
            _ => {}
        }
    }
    files
}

/// Refuses a setting's path that leads to no key.
fn known(schema: &Schema, path: &[Step]) -> Result<(), String> {
    let names: Vec<&str> = path.iter().map(|(name, _)| name.as_str()).collect();
    let (key, sections) = names.split_last().ok_or("a key is wanted")?;
    let wanted = sections.join(".");
    let section = schema.sections.iter().find(|s| s.path == wanted);
    if section.is_some_and(|section| section.key(key).is_some()) {
        return Ok(());
    }
    let whole = names.join(".");
    let all: Vec<String> = schema
        .sections
        .iter()
        .flat_map(|section| section.keys.iter().map(|key| join(section.path, key.name)))
        .collect();
    let meant = nearest::nearest(&whole, all.iter().map(String::as_str))
        .map(|path| format!("; did you mean '{path}'?"))
        .unwrap_or_default();
    Err(format!(
        "there is no key '{whole}'{meant} (the reference of keys lists all)"
    ))
}

fn join(section: &str, key: &str) -> String {
    match section {
        "" => key.to_owned(),
        _ => format!("{section}.{key}"),
    }
}
