//! Text of a job: reading, validation against the schema, and settings as JSON.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use subaperture_describe::error::Fault;
use subaperture_describe::schema::Schema;
use subaperture_describe::values::{self, Values};
use subaperture_describe::{Description, DescriptionError};
use subaperture_io::remote;

/// Error of reading a job.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The text cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the text.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The text is not a valid job.
    #[error(transparent)]
    Description(#[from] DescriptionError),
}

/// Validated text of a job, with its values.
#[derive(Clone, Debug)]
pub struct JobText {
    description: Description,
    values: Values,
}

impl JobText {
    /// Read a text that takes at most `memory_bytes` when it is parsed, and apply overrides (key and value, as `former.error` and
    /// `-50 dB`). Errors attribute an override to `option`.
    ///
    /// # Errors
    /// The file cannot be read, or the list of all faults in the text.
    pub fn read(
        path: &Path,
        schema: &Schema,
        option: &str,
        settings: &[(String, String)],
        memory_bytes: u64,
    ) -> Result<Self, JobError> {
        let read = Description::read_within(path, memory_bytes).map_err(|source| JobError::Read {
            path: path.to_owned(),
            source,
        });
        let mut description = read?;
        for (key, value) in settings {
            description.set(schema, option, key, value)?;
        }
        Ok(Self::new(description, schema)?)
    }

    /// Validate a description against the schema of jobs.
    ///
    /// # Errors
    /// All faults, with line numbers.
    pub fn new(description: Description, schema: &Schema) -> Result<Self, DescriptionError> {
        let resolved = description.resolve(schema);
        let values = resolved.map_err(|faults| description.explain(faults))?;
        Ok(Self {
            description,
            values,
        })
    }

    /// All values, with defaults filled in.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Resolve a path of the text relative to the text's folder. A URL is left unchanged.
    pub fn path(&self, path: impl AsRef<Path>) -> PathBuf {
        match remote::url(path.as_ref()) {
            Some(_) => path.as_ref().to_owned(),
            None => self.description.folder().join(path),
        }
    }

    /// Error text of faults, with line numbers.
    pub fn explain(&self, faults: Vec<Fault>) -> DescriptionError {
        self.description.explain(faults)
    }

    /// Values of a section with defaults, and the same as JSON by key; `None` if the section is absent. The top level is "".
    pub fn section(&self, name: &str) -> Option<(&Values, Map<String, Value>)> {
        let section = match name {
            "" => &self.values,
            name => self.values.optional_section(name)?,
        };
        let keys = section.keys.iter();
        let settings = keys.map(|(key, given)| ((*key).to_owned(), as_json(&given.value)));
        Some((section, settings.collect()))
    }

    /// Settings of these sections with defaults, by key, as `former.error`. Absent optional sections contribute no settings.
    pub fn settings(&self, sections: &[&str]) -> Map<String, Value> {
        let sections = sections.iter().filter_map(|name| {
            let (_, settings) = self.section(name)?;
            Some(
                settings
                    .into_iter()
                    .map(move |(key, value)| (format!("{name}.{key}"), value)),
            )
        });
        sections.flatten().collect()
    }
}

fn as_json(value: &values::Value) -> Value {
    match value {
        values::Value::Text(text) => json!(text),
        values::Value::Texts(texts) => json!(texts),
        values::Value::Flag(flag) => json!(flag),
        values::Value::Count(count) => json!(count),
        values::Value::Number(number) => json!(number),
        values::Value::Numbers(numbers) => json!(numbers),
        values::Value::Rows(rows) => json!(rows),
    }
}
