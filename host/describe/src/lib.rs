//! TOML descriptions (scenarios, recordings, jobs) whose quantities carry units.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; module `describe` of the crate
//! `subaperture`.
//!
//! Every text is checked against a schema, which can be printed as the key reference. Errors give file, line and column,
//! show the line, and say what to do; several faults are reported at once.
//!
//! ```text
//! structs (declare) ─> schema ──> reference
//!                        v
//! text ─> tree (values and positions; settings applied) ─> resolve (names, types, units, bounds,
//!         defaults) ─> values ─> structs, read by builders
//! ```
//!
//! A section is declared once, as a struct: from its fields come the schema and the values, so that a builder names a field,
//! never a key as text, and the compiler reports fields that no builder reads. Conditions on several keys (that one of two keys is
//! given, that an interval is long enough) are ordinary code of the builder, whose faults point at a [`declare::Located`] value.
//!
//! A setting overrides one key of the text, such as `radar.pri` or `scene.point[0].position`, or one component of a vector or an interval, such
//! as `platform.velocity[0]`. Its errors name the key instead of a line.
#![forbid(unsafe_code)]

// The name that declared sections refer to.
extern crate self as subaperture_describe;

mod component;
pub mod declare;
mod edit;
pub mod error;
pub mod memory;
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

use std::borrow::Cow;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use toml_parser::Source;
use toml_parser::decoder::ScalarKind;

use declare::Declared;
use error::{ALLOW_MORE_MEMORY, Fault, Location, explain};
use schema::{Schema, Section};
use subaperture_model::nearest::nearest;
use tree::{Step, apply_setting, parse_path, parse_setting};
use values::Values;

pub use subaperture_model::units::Dimension;

pub use error::{DescriptionError, RenderedFault};
pub use memory::DEFAULT_MEMORY_BYTES;

/// Maximum size of a text, bytes; less where memory is limited.
const LONGEST_BYTES: u64 = 64 << 20;
/// Part of the memory that a text itself may take.
const TEXT_PART: u64 = 8;

/// Description text with the settings that override it.
#[derive(Clone, Debug)]
pub struct Description {
    file: String,
    text: String,
    folder: PathBuf,
    settings: Vec<Setting>,
    memory_bytes: u64,
}

#[derive(Clone, Debug)]
struct Setting {
    path: Vec<Step>,
    value: String,
    /// Option as written, for errors: `--set KEY=VALUE`.
    words: String,
}

impl Description {
    /// Make a description of a text. `file` is its name in errors; relative paths start at `folder`.
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
            memory_bytes: DEFAULT_MEMORY_BYTES,
        }
    }

    /// Read a description file; parsing may take [`DEFAULT_MEMORY_BYTES`].
    ///
    /// # Errors
    /// As [`Self::read_within`].
    pub fn read(path: &Path) -> io::Result<Self> {
        Self::read_within(path, DEFAULT_MEMORY_BYTES)
    }

    /// Read a description file whose text takes at most an eighth of `memory_bytes`, and parsed no more than these. The latter is checked
    /// when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read, is not UTF-8, or is larger than an eighth of the memory or than 64 MiB.
    pub fn read_within(path: &Path, memory_bytes: u64) -> io::Result<Self> {
        let mut text = String::new();
        let most_bytes = LONGEST_BYTES.min(memory_bytes / TEXT_PART);
        // Limited while reading, since pipes and devices have no length and may be endless.
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(most_bytes + 1).read_to_string(&mut text));
        if text.len() as u64 > most_bytes {
            let most = memory::mebibytes(most_bytes);
            return Err(io::Error::other(match most_bytes == LONGEST_BYTES {
                true => format!(
                    "larger than {most}: expected a scenario or a recording's description in TOML"
                ),
                false => format!(
                    "expected TOML of at most {most}, an eighth of the memory of {}, found more: divide it into smaller files, or {ALLOW_MORE_MEMORY}",
                    memory::mebibytes(memory_bytes)
                ),
            }));
        }
        read.map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => io::Error::new(
                error.kind(),
                "not UTF-8 text: expected a scenario or a recording's description in TOML",
            ),
            io::ErrorKind::IsADirectory => io::Error::new(
                error.kind(),
                "this is a folder: expected a scenario or a recording's description in TOML",
            ),
            _ => error,
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Self {
            memory_bytes,
            ..Self::new(path.display().to_string(), text, folder)
        })
    }

    /// Folder at which relative paths in the text start.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Override the key at a dotted path. Later settings override earlier ones. Errors name the key with the
    /// command-line `option`.
    ///
    /// # Errors
    /// For an unknown key. Values are checked by [`Self::resolve`].
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
                let found = Fault::new(&Location::Setting(0), message);
                Err(explain(&self.file, &self.text, &[words], vec![found]))
            }
        }
    }

    /// Check the text with its settings against a schema, and return the values.
    ///
    /// # Errors
    /// All faults, to be rendered by [`Self::explain`].
    pub fn resolve(&self, schema: &Schema) -> Result<Values, Vec<Fault>> {
        let mut tree = tree::parse(&self.text, self.memory_bytes).map_err(|found| vec![found])?;
        for (index, setting) in self.settings.iter().enumerate() {
            let value = parse_setting(&setting.value, index);
            apply_setting(&mut tree, &setting.path, value).map_err(|found| vec![found])?;
        }
        let mut faults = Vec::new();
        let top = resolve::resolve(
            schema,
            &schema.sections[0],
            &tree,
            &Location::Text(0..0),
            &mut faults,
        );
        if faults.is_empty() {
            Ok(top)
        } else {
            Err(faults)
        }
    }

    /// Check the text with its settings against the schema of `T`, and read it.
    ///
    /// # Errors
    /// As [`Self::resolve`].
    pub fn resolve_as<T: Declared>(&self, schema: &Schema) -> Result<T, Vec<Fault>> {
        self.resolve(schema).map(|values| T::read(&values))
    }

    /// The text with the keys at the given dotted paths set to the given values, and nothing else changed. Settings are
    /// not included.
    ///
    /// # Errors
    /// A message, if the text has no place for one of the keys.
    pub fn with_values<'a>(
        &self,
        values: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<String, String> {
        let mut text = self.text.clone();
        for (key, value) in values {
            text = edit::set_value(&text, &parse_path(key)?, value, self.memory_bytes)?;
        }
        Ok(text)
    }

    /// The text without settings.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// String at the key `key` of the top-level section `section`, without settings; `None` without such a string or if the text is not TOML.
    pub fn string_at(&self, section: &str, key: &str) -> Option<String> {
        let tree = tree::parse(&self.text, self.memory_bytes).ok()?;
        let tree::Raw::Table(table) = &tree.get(section)?.1.raw else {
            return None;
        };
        match &table.get(key)?.1.raw {
            tree::Raw::Text(text) => Some(text.clone()),
            _ => None,
        }
    }

    /// Position of the top-level section `name`; `None` if there is none or the text is not TOML.
    pub fn has_section(&self, name: &str) -> Option<Location> {
        let tree = tree::parse(&self.text, self.memory_bytes).ok()?;
        let (at, node) = tree.get(name)?;
        matches!(node.raw, tree::Raw::Table(_)).then(|| at.clone())
    }

    /// Render faults with their lines.
    pub fn explain(&self, faults: Vec<Fault>) -> DescriptionError {
        let words: Vec<String> = self.settings.iter().map(|s| s.words.clone()).collect();
        explain(&self.file, &self.text, &words, faults)
    }
}

/// Files named by the description at `path`: every string in it that is the path of a file, for any key. Empty if the
/// file cannot be read.
pub fn named_files(path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let about = std::fs::metadata(path);
    // A pipe can be read only once, and a device may be endless.
    let whole = about.is_ok_and(|about| about.is_file() && about.len() <= LONGEST_BYTES);
    let mut text = String::new();
    if whole {
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(LONGEST_BYTES).read_to_string(&mut text));
        if read.is_err() {
            text.clear();
        }
    }
    // Token by token: no tree is held.
    let source = Source::new(&text);
    let strings = source.lex().filter_map(|token| {
        token.kind().encoding()?;
        let mut string = Cow::Borrowed("");
        let kind = source.get(token)?.decode_scalar(&mut string, &mut ());
        matches!(kind, ScalarKind::String).then_some(string)
    });
    let files = strings.map(|string| folder.join(&*string));
    files.filter(|file| file.is_file()).collect()
}

/// Check that a setting's path leads to a key.
fn known(schema: &Schema, path: &[Step]) -> Result<(), String> {
    let names: Vec<&str> = path.iter().map(|(name, _)| name.as_str()).collect();
    let (key, sections) = names.split_last().ok_or("expected a key")?;
    let wanted = sections.join(".");
    let section = schema.sections.iter().find(|s| s.path == wanted);
    if let Some(found) = section.and_then(|section| section.key(key)) {
        let index = path.last().and_then(|(_, index)| *index);
        return match (index, component::count(&found.kind)) {
            (Some(index), count) if index >= count => Err(match count {
                0 => format!("'{key}' has no components: remove the index"),
                _ => format!(
                    "'{key}' has {count} components: write an index from 0 to {}",
                    count - 1
                ),
            }),
            _ => Ok(()),
        };
    }
    let whole = names.join(".");
    Err(format!(
        "unknown key '{whole}'; {} (the reference of keys lists all)",
        suggestion(schema, section, &wanted, key)
    ))
}

/// Suggestion for an unknown key `key` in the section `wanted`, which is `section` if it exists. Words of the path are
/// compared one by one, since a short key is too small a part of a whole path.
fn suggestion(schema: &Schema, section: Option<&Section>, wanted: &str, key: &str) -> String {
    let own = |section: &Section| -> Vec<&'static str> {
        section.keys.iter().map(|key| key.name).collect()
    };
    if let Some(section) = section
        && let Some(name) = nearest(key, own(section))
    {
        return format!("did you mean '{}'?", join(&section.path, name));
    }
    let all = || schema.sections.iter();
    // A valid key in the wrong section, or a misspelt section.
    let elsewhere: Vec<String> = all()
        .filter(|section| section.key(key).is_some())
        .map(|section| format!("'{}'", join(&section.path, key)))
        .collect();
    if !elsewhere.is_empty() {
        return format!("did you mean {}?", elsewhere.join(" or "));
    }
    let near = nearest(wanted, all().map(|section| &*section.path));
    match section.or_else(|| all().find(|section| Some(&*section.path) == near)) {
        Some(section) => match nearest(key, own(section)) {
            Some(name) => format!("did you mean '{}'?", join(&section.path, name)),
            None => format!("{} has {}", section.header(), own(section).join(", ")),
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
