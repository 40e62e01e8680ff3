//! Texts that describe something, a scenario, a recording or a job: TOML whose quantities carry their units.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `describe`.
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
#![forbid(unsafe_code)]

mod edit;
pub mod error;
pub mod keys;
mod of_kind;
pub mod place;
pub mod radar;
pub mod receiver;
mod reference;
mod resolve;
pub mod schema;
pub mod track;
mod tree;
pub mod values;

use std::io;
use std::path::{Path, PathBuf};

use error::{At, Found, explain};
use schema::{Schema, Section};
use subaperture_model::nearest::nearest;
use tree::{Step, lay_over, parse_path, parse_setting};
use values::Values;

pub use error::{DescriptionError, Fault};

/// Longest text that is read, bytes: far longer than anyone writes, for its tree takes a hundred times as many.
const LONGEST_BYTES: u64 = 4 << 20;

/// A text and the settings that override it.
#[derive(Clone, Debug)]
pub struct Description {
    file: String,
    text: String,
    folder: PathBuf,
    settings: Vec<Setting>,
}

#[derive(Clone, Debug)]
struct Setting {
    path: Vec<Step>,
    value: String,
    /// `--set KEY=VALUE`, for errors.
    words: String,
}

impl Description {
    /// `file` names the text in errors; paths in it start at `folder`.
    pub fn new(
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
    /// If the file cannot be read, is no UTF-8, or has more than 4 MiB.
    pub fn read(path: &Path) -> io::Result<Self> {
        if std::fs::metadata(path)?.len() > LONGEST_BYTES {
            return Err(io::Error::other(
                "more than 4 MiB: is this a scenario or a recording's description?",
            ));
        }
        let text = std::fs::read_to_string(path).map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => io::Error::new(
                error.kind(),
                "it is no UTF-8 text, and a scenario or a recording's description in TOML is wanted",
            ),
            io::ErrorKind::IsADirectory => io::Error::new(
                error.kind(),
                "it is a folder, and a scenario or a recording's description in TOML is wanted",
            ),
            _ => error,
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Self::new(path.display().to_string(), text, folder))
    }

    /// Where paths in the text start.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Overrides the key at a dotted path. Later settings override earlier ones. Errors name it as what `option` of
    /// the command line asked for.
    ///
    /// # Errors
    /// For a key that there is not; values are checked by [`Self::resolve`].
    pub fn set(
        &mut self,
        schema: &Schema,
        option: &str,
        key: &str,
        value: &str,
    ) -> Result<(), DescriptionError> {
        let words = format!("{option} {key}={value}");
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
    pub fn resolve(&self, schema: &Schema) -> Result<Values, Vec<Found>> {
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

    /// The text with the keys at these dotted paths set to these values, and nothing else changed; settings are not
    /// written.
    ///
    /// # Errors
    /// In words, if the text has no place for one of them.
    pub fn with_values<'a>(
        &self,
        values: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<String, String> {
        let mut text = self.text.clone();
        for (key, value) in values {
            text = edit::put(&text, &parse_path(key)?, value)?;
        }
        Ok(text)
    }

    /// The text as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Where the section of this name at the top of the text is; `None` too if the text is no TOML.
    pub fn has_section(&self, name: &str) -> Option<At> {
        let tree = tree::parse(&self.text).ok()?;
        let (at, node) = tree.get(name)?;
        matches!(node.raw, tree::Raw::Table(_)).then(|| at.clone())
    }

    /// Puts what is wrong into words, with its lines.
    pub fn explain(&self, faults: Vec<Found>) -> DescriptionError {
        let words: Vec<String> = self.settings.iter().map(|s| s.words.clone()).collect();
        explain(&self.file, &self.text, &words, faults)
    }
}

/// Files that the description at `path` names: every text in it that is the path of one, whatever its key. Errors are for
/// who reads it.
pub fn named_files(path: &Path) -> Vec<PathBuf> {
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
    Err(format!(
        "there is no key '{whole}'; {} (the reference of keys lists all)",
        meant(schema, section.copied(), &wanted, key)
    ))
}

/// What may have been meant by the last word `key` of a path through the section `wanted`, which is `section` if
/// there is one. Words are compared one by one: of a whole path, a short key is too small a part to tell.
fn meant(schema: &Schema, section: Option<&'static Section>, wanted: &str, key: &str) -> String {
    let own = |section: &'static Section| section.keys.iter().map(|key| key.name);
    if let Some(section) = section
        && let Some(name) = nearest(key, own(section))
    {
        return format!("did you mean '{}'?", join(section.path, name));
    }
    let all = || schema.sections.iter().copied();
    // The right key in the wrong section, or the right section misspelt.
    let elsewhere: Vec<String> = all()
        .filter(|section| section.key(key).is_some())
        .map(|section| format!("'{}'", join(section.path, key)))
        .collect();
    if !elsewhere.is_empty() {
        return format!("did you mean {}?", elsewhere.join(" or "));
    }
    let near = nearest(wanted, all().map(|section| section.path));
    match section.or_else(|| all().find(|section| Some(section.path) == near)) {
        Some(section) => match nearest(key, own(section)) {
            Some(name) => format!("did you mean '{}'?", join(section.path, name)),
            None => format!(
                "{} has {}",
                section.header(),
                own(section).collect::<Vec<_>>().join(", ")
            ),
        },
        None => format!(
            "sections are {}",
            all()
                .filter(|section| !section.path.is_empty())
                .map(Section::header)
                .collect::<Vec<_>>()
                .join(", ")
        ),
    }
}

fn join(section: &str, key: &str) -> String {
    match section {
        "" => key.to_owned(),
        _ => format!("{section}.{key}"),
    }
}
