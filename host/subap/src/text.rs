//! Formatting of numbers and facts for display.

use std::io::{self, Write};
use std::time::Duration;

use serde::Serialize;
use subaperture::quantity;

use crate::messages;
use crate::terminal::printable;

pub(crate) use subaperture::quantity::{bytes, degrees, hertz, seconds, significant};

/// Error of printing a result.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SayError {
    /// The reader of standard output has closed it; not a failure.
    #[error("standard output was closed by its reader")]
    ReaderGone,
    /// The operating system refused.
    #[error("cannot write to standard output: {0}")]
    Io(io::Error),
}

impl From<io::Error> for SayError {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::ReaderGone,
            _ => Self::Io(error),
        }
    }
}

/// Print a result of one or more lines on standard output.
///
/// # Errors
/// [`SayError`].
pub(crate) fn say(line: impl AsRef<str>) -> Result<(), SayError> {
    let line = printable(line.as_ref().trim_end_matches('\n'));
    messages::result(&line);
    print(format!("{line}\n").as_bytes())
}

/// Print a result as JSON: the object `value`, with `schema` (`subaperture-` and `name`), `schema_version`
/// if missing, and all warnings so far.
///
/// # Errors
/// [`SayError`].
pub(crate) fn say_json(name: &str, value: impl Serialize) -> anyhow::Result<()> {
    let mut value = serde_json::to_value(value)?;
    if let Some(object) = value.as_object_mut() {
        let mut add = |key: &str, value| {
            object.entry(key).or_insert(value);
        };
        add("schema", format!("subaperture-{name}").into());
        add("schema_version", 1.into());
        object.insert("warnings".to_owned(), messages::warnings().into());
    }
    let schema = value["schema"].as_str().unwrap_or(name);
    messages::result(&format!("{schema}, as JSON on standard output"));
    print(format!("{}\n", serde_json::to_string_pretty(&value)?).as_bytes())?;
    Ok(())
}

/// Format a level in decibels, without a minus sign before zero.
pub(crate) fn decibels(level_db: f64) -> String {
    // Adding zero turns -0 into 0.
    format!("{:.2} dB", (level_db * 100.0).round() / 100.0 + 0.0)
}

/// Write bytes to standard output unchanged.
///
/// # Errors
/// [`SayError`].
pub(crate) fn print(bytes: &[u8]) -> Result<(), SayError> {
    let mut out = io::stdout().lock();
    out.write_all(bytes)?;
    Ok(out.flush()?)
}

/// Format a duration to a tenth of a second, or in minutes.
pub(crate) fn duration(taken: Duration) -> String {
    let seconds = taken.as_secs_f64();
    if seconds < 100.0 {
        format!("{seconds:.1} s")
    } else {
        format!("{} min {:.0} s", taken.as_secs() / 60, seconds % 60.0)
    }
}

/// Format a length, or `none`.
pub(crate) fn metres(value_m: Option<f64>) -> String {
    value_m.map_or_else(|| "none".to_owned(), quantity::metres)
}

/// Format a table with aligned columns, the first to the left, the others to the right.
pub(crate) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells
            .chain([header[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (cell, &width))| {
                if column == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let titles: Vec<String> = header.iter().map(|title| (*title).to_owned()).collect();
    let mut lines = vec![line(&titles)];
    lines.extend(rows.iter().map(|row| line(row)));
    lines.join("\n")
}

/// Label and value of a line of text.
pub(crate) type Fact = (&'static str, String);

/// Format labelled facts as aligned lines.
pub(crate) fn facts(facts: &[Fact]) -> Vec<String> {
    facts
        .iter()
        .map(|(label, value)| format!("{label:<16} {value}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_lengths_have_few_digits() {
        assert_eq!(duration(Duration::from_millis(1234)), "1.2 s");
        assert_eq!(duration(Duration::from_secs(125)), "2 min 5 s");
        assert_eq!(metres(None), "none");
        assert_eq!(metres(Some(0.2408)), "0.2408 m");
    }

    #[test]
    fn levels_have_no_minus_before_zero() {
        assert_eq!(decibels(-0.004), "0.00 dB");
        assert_eq!(decibels(-3.456), "-3.46 dB");
    }

    #[test]
    fn tables_are_aligned() {
        let rows = vec![
            vec!["bp".to_owned(), "-46.5".to_owned()],
            vec!["exact".to_owned(), "0".to_owned()],
        ];
        assert_eq!(
            table(&["former", "dB"], &rows),
            "former     dB\nbp      -46.5\nexact       0"
        );
    }
}
