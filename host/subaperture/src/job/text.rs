//! Text of a job: reading, validation against the schema, and settings as JSON.

use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use subaperture_describe::error::Fault;
use subaperture_describe::values::{self, Values};
use subaperture_describe::{Description, DescriptionError};

use super::keys::SCHEMA;

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
            description.set(&SCHEMA, option, key, value)?;
        }
        Ok(Self::new(description)?)
    }

    /// Validate a description as a job.
    ///
    /// # Errors
    /// All faults, with line numbers.
    pub fn new(description: Description) -> Result<Self, DescriptionError> {
        let resolved = description.resolve(&SCHEMA);
        let values = resolved.map_err(|faults| description.explain(faults))?;
        let job = Self {
            description,
            values,
        };
        match job.faults() {
            faults if faults.is_empty() => Ok(job),
            faults => Err(job.explain(faults)),
        }
    }

    /// Faults of combinations of keys.
    fn faults(&self) -> Vec<Fault> {
        let within = |name: &str| self.values.optional_section(name);
        let mut faults = Vec::new();
        if let (Some(_), Some(autofocus)) = (within("track"), within("autofocus")) {
            let what = "autofocus is of the positions as recorded, and [track] replaces them: leave one of the two out";
            faults.push(Fault::new(&autofocus.at, what));
        }
        let input = self.values.section("input");
        if input.optional_text("channel").is_some() && input.optional_text("channels").is_some() {
            faults.push(input.fault("channels", "give either channel or channels, not both"));
        }
        faults
    }

    /// All values, with defaults filled in.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Resolve a path of the text relative to the text's folder.
    pub fn path(&self, text: &str) -> PathBuf {
        self.description.folder().join(text)
    }

    /// Error text of faults, with line numbers.
    pub fn explain(&self, faults: Vec<Fault>) -> DescriptionError {
        self.description.explain(faults)
    }

    /// Settings of these sections with defaults, by key, as `former.error`. Absent optional sections contribute no settings.
    pub fn settings(&self, sections: &[&str]) -> Map<String, Value> {
        let mut settings = Map::new();
        for name in sections {
            let Some(section) = self.values.optional_section(name) else {
                continue;
            };
            for (key, given) in &section.keys {
                settings.insert(format!("{name}.{key}"), as_json(&given.value));
            }
        }
        settings
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::EXAMPLE;

    fn job(text: &str) -> Result<JobText, DescriptionError> {
        JobText::new(Description::new("job.toml", text, "/data"))
    }

    #[test]
    fn the_example_is_a_job_and_names_every_section_and_key() {
        let job = job(EXAMPLE).unwrap();
        assert_eq!(job.path("a.cphd"), Path::new("/data/a.cphd"));
        for section in SCHEMA.sections {
            let header = section.header();
            assert!(
                section.path.is_empty() || EXAMPLE.contains(&header),
                "{header}"
            );
            for key in section.keys {
                let named = EXAMPLE.lines().any(|line| {
                    let line = line.trim_start_matches(['#', ' ']);
                    line.strip_prefix(key.name)
                        .is_some_and(|rest| rest.trim_start().starts_with('='))
                });
                assert!(named, "{header} {}", key.name);
            }
        }
    }

    #[test]
    fn settings_take_defaults_and_omit_unrequested_stages() {
        let job = job("[input]\nfiles = \"a.cphd\"\n[former]\nerror = \"-40 dB\"\n").unwrap();
        let settings = job.settings(&["former", "autofocus", "check"]);
        assert_eq!(settings["former.error"], json!(-40.0));
        assert_eq!(settings["former.algorithm"], json!("auto"));
        assert_eq!(settings["check.pixels"], json!(64));
        assert!(!settings.keys().any(|key| key.starts_with("autofocus")));
    }

    #[test]
    fn faults_are_shown_with_their_line() {
        for (text, place, parts) in [
            (
                "[inptu]\nfiles = \"a\"\n",
                "job.toml:1:2",
                ["inptu", "did you mean 'input'"],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nalgorithm = \"ffpb\"\n",
                "job.toml:4:13",
                ["ffpb", "did you mean \"ffbp\""],
            ),
            (
                "[input]\nfiles = \"a\"\n[products]\nformats = [\"sicd\", \"cogs\"]\n",
                "job.toml:4:20",
                ["cogs", "did you mean \"cog\""],
            ),
            (
                "[input]\nfiles = \"a\"\n[former]\nerror = -40\n",
                "job.toml:4:9",
                ["error", "without a unit"],
            ),
            (
                "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\n[autofocus]\n",
                "job.toml:5:1",
                ["as recorded", "leave one of the two out"],
            ),
            (
                "[input]\nfiles = \"a\"\n[track]\nsource = \"mpga\"\nfile = \"t.csv\"\n",
                "job.toml:5:1",
                ["file", "does not apply"],
            ),
        ] {
            let error = job(text).unwrap_err();
            let fault = error.faults.iter().find(|fault| fault.place == place);
            let fault = fault.unwrap_or_else(|| panic!("{place}: {error}"));
            assert!(fault.excerpt.contains('^'), "{error}");
            for part in parts {
                assert!(fault.message.contains(part), "{part}: {error}");
            }
        }
        let none = job("").unwrap_err().to_string();
        assert!(none.contains("files"), "{none}");
    }
}
