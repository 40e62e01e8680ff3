//! Log of `--log FILE`: all messages, with additional detail and times.
//!
//! The log is appended to, so one file can record several runs. Every line is flushed when written, so the log of a failed or killed
//! run is complete up to its end. Formats: text, or one JSON object per line:
//!
//! | `kind` | keys in addition to `time` and `message` |
//! |---|---|
//! | `begin` | `command_line`, `version`, `threads`, `memory_bytes` |
//! | `setting` | `key`, `value` |
//! | `note`, `warning`, `error`, `result` | |
//! | `progress` | `work`, `fraction` (`null` if not known), `elapsed_s` |
//! | `timing` | `work`, `elapsed_s`: duration of the work |
//! | `end` | `exit_status`, `elapsed_s` |

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use clap::ValueEnum;
use serde_json::{Map, Value};

/// Format of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// A line begins with time and kind
    Text,
    /// A line is a JSON object
    Json,
}

impl Format {
    /// Format by the file's extension: JSON for `.json`, `.jsonl` and `.ndjson`.
    pub(crate) fn of(path: &Path) -> Self {
        let ending = path.extension().and_then(|ending| ending.to_str());
        match ending {
            Some("json" | "jsonl" | "ndjson") => Self::Json,
            _ => Self::Text,
        }
    }
}

/// Log file that is being written.
pub(crate) struct Log {
    file: File,
    format: Format,
}

impl Log {
    /// Open a log for appending, or create it.
    ///
    /// # Errors
    /// If the file cannot be written, or contains something other than a log.
    pub(crate) fn open(path: &Path, format: Format) -> anyhow::Result<Self> {
        let name = || format!("cannot write the log {}", path.display());
        if path.is_file() {
            let mut start = Vec::new();
            let file = File::open(path).with_context(name)?;
            file.take(64).read_to_end(&mut start).with_context(name)?;
            if !start.is_empty() && !is_log(&start) {
                bail!(
                    "--log {}: expected a log of subap, found another file: give another name",
                    path.display()
                );
            }
        }
        let file = OpenOptions::new().append(true).create(true).open(path);
        Ok(Self {
            file: file.with_context(name)?,
            format,
        })
    }

    /// Append a message with the current time.
    pub(crate) fn write(
        &mut self,
        kind: &str,
        message: &str,
        more: Map<String, Value>,
    ) -> io::Result<()> {
        let time = utc(SystemTime::now());
        let line = match self.format {
            Format::Text => {
                // Further lines of a message are indented, so that every unindented line starts with time and kind.
                format!("{time} {kind}: {}\n", message.replace('\n', "\n    "))
            }
            Format::Json => {
                // Built by hand so that the time comes first.
                let message = Value::from(message);
                let head =
                    format!("{{\"time\":\"{time}\",\"kind\":\"{kind}\",\"message\":{message}");
                match more.is_empty() {
                    true => format!("{head}}}\n"),
                    false => format!("{head},{}\n", &Value::Object(more).to_string()[1..]),
                }
            }
        };
        // One write per line, so that lines of several runs in one file are not mixed.
        self.file.write_all(line.as_bytes())
    }
}

/// Whether a file starts like a log of either format, with a time.
fn is_log(start: &[u8]) -> bool {
    let shape = b"0000-00-00T00:00:00.000Z";
    let start = start.strip_prefix(b"{\"time\":\"").unwrap_or(start);
    start.len() >= shape.len()
        && start.iter().zip(shape).all(|(byte, shape)| match shape {
            b'0' => byte.is_ascii_digit(),
            _ => byte == shape,
        })
}

/// Current time in the format of logs.
pub(crate) fn now() -> String {
    utc(SystemTime::now())
}

/// UTC as `2026-03-01T12:00:00.000Z`; times before 1970 are clamped to 1970.
pub(crate) fn utc(time: SystemTime) -> String {
    let since = time.duration_since(SystemTime::UNIX_EPOCH);
    let since = since.unwrap_or(Duration::ZERO);
    let seconds = since.as_secs();
    let (year, month, day) = date(seconds / 86_400);
    let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    let millis = since.subsec_millis();
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{millis:03}Z")
}

/// Year, month and day of a number of days since 1 January 1970.
fn date(mut days: u64) -> (u64, usize, u64) {
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    // Skip whole cycles of 400 years, so that the loop is short for any clock value.
    let mut year = 1970 + 400 * (days / 146_097);
    days %= 146_097;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    (year, month, days + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        // By the definition of POSIX time: a leap day, a century that is not a leap year, one that is.
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00.000Z"),
            (951_782_400, "2000-02-29T00:00:00.000Z"),
            (951_868_799, "2000-02-29T23:59:59.000Z"),
            (4_107_542_400, "2100-03-01T00:00:00.000Z"),
            (1_700_000_000, "2023-11-14T22:13:20.000Z"),
        ] {
            let time = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
            assert_eq!(utc(time), text);
        }
    }

    #[test]
    fn only_a_log_is_appended_to() {
        let folder = tempfile::tempdir().unwrap();
        for (name, format) in [("a.log", Format::Text), ("a.jsonl", Format::Json)] {
            let path = folder.path().join(name);
            assert_eq!(Format::of(&path), format);
            for message in ["first", "second\nof two lines"] {
                let mut log = Log::open(&path, format).unwrap();
                log.write("note", message, Map::new()).unwrap();
            }
            let text = std::fs::read_to_string(&path).unwrap();
            assert_eq!(text.matches("note").count(), 2, "{text}");
        }
        let path = folder.path().join("scenario.toml");
        std::fs::write(&path, "[radar]\n").unwrap();
        let error = Log::open(&path, Format::Text).err().unwrap().to_string();
        assert!(error.contains("expected a log of subap"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "[radar]\n");
    }
}
