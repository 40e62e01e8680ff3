//! What is wrong in a description, where, and what to do.

use std::fmt;
use std::ops::Range;

/// Where something in a description came from.
#[derive(Clone, Debug, PartialEq)]
pub enum At {
    /// Bytes of the text.
    Text(Range<usize>),
    /// The setting of this index, which overrides the text.
    Setting(usize),
}

/// Something wrong, not yet put into words with its line.
#[derive(Clone, Debug)]
pub struct Found {
    /// Where.
    pub at: At,
    /// What is wrong, and what to do.
    pub message: String,
}

impl Found {
    /// Something wrong at a place.
    pub fn new(at: &At, message: impl Into<String>) -> Self {
        Self {
            at: at.clone(),
            message: message.into(),
        }
    }
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// `FILE:LINE:COLUMN`, or the option, as `--set KEY=VALUE`.
    pub place: String,
    /// Line in the text, from 1; `None` of a setting.
    pub line: Option<usize>,
    /// Column in characters, from 1; `None` of a setting.
    pub column: Option<usize>,
    /// The line with a caret under what is wrong; empty of a setting.
    pub excerpt: String,
    /// What is wrong and what to do.
    pub message: String,
}

/// How a message ends where more memory would help.
pub const ALLOW_MORE_MEMORY: &str = "allow more memory";

impl Fault {
    /// Whether more memory would help.
    pub fn wants_memory(&self) -> bool {
        self.message.ends_with(ALLOW_MORE_MEMORY)
    }
}

/// A description that does not make sense, with everything that was found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct DescriptionError {
    /// At least one, in the order of the text.
    pub faults: Vec<Fault>,
}

impl fmt::Display for DescriptionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.faults.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{}: {}", fault.place, fault.message)?;
            if !fault.excerpt.is_empty() {
                write!(f, "\n{}", fault.excerpt)?;
            }
        }
        Ok(())
    }
}

/// Faults reported at once; the first ones often explain the others.
const MOST_FAULTS: usize = 8;

/// Characters of a line that are shown before and after what is wrong.
const SHOWN_BEFORE: usize = 60;
const SHOWN_AFTER: usize = 100;

/// Puts what was found into words. `settings` are the options, as `--set KEY=VALUE`.
pub fn explain(
    file: &str,
    text: &str,
    settings: &[String],
    mut found: Vec<Found>,
) -> DescriptionError {
    found.sort_by_key(|found| match &found.at {
        At::Text(range) => (0, range.start),
        At::Setting(index) => (1, *index),
    });
    let faults = found.into_iter().take(MOST_FAULTS);
    DescriptionError {
        faults: faults
            .map(|found| match found.at {
                At::Setting(index) => Fault {
                    place: settings[index].clone(),
                    line: None,
                    column: None,
                    excerpt: String::new(),
                    message: found.message,
                },
                At::Text(range) => in_text(file, text, &range, found.message),
            })
            .collect(),
    }
}

fn in_text(file: &str, text: &str, range: &Range<usize>, message: String) -> Fault {
    let mut start = range.start.min(text.len());
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    let before = &text[..start];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let line = before.matches('\n').count() + 1;
    let column = text[line_start..start].chars().count() + 1;
    let whole: Vec<char> = text[line_start..]
        .lines()
        .next()
        .unwrap_or_default()
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    // Of what goes on in the next line only the part in this one is underlined.
    let end = range.end.clamp(start, text.len());
    let mut stop = end;
    while !text.is_char_boundary(stop) {
        stop -= 1;
    }
    let marked = text[start..stop].lines().next().unwrap_or_default();
    let from = column.saturating_sub(1 + SHOWN_BEFORE).min(whole.len());
    let to = (column - 1 + SHOWN_AFTER).min(whole.len());
    let shown: String = whole[from..to].iter().collect();
    let carets = marked.chars().count().clamp(1, SHOWN_AFTER);
    let margin = " ".repeat(line.to_string().len());
    let quoted = format!("  {line} | {shown}");
    let excerpt = format!(
        "{}\n  {margin} | {}{}",
        quoted.trim_end(),
        " ".repeat(column - 1 - from),
        "^".repeat(carets)
    );
    Fault {
        place: format!("{file}:{line}:{column}"),
        line: Some(line),
        column: Some(column),
        excerpt,
        message,
    }
}

impl From<DescriptionError> for subaperture_model::phase_history::ReadError {
    fn from(error: DescriptionError) -> Self {
        Self::Description(Box::new(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caret_stands_under_the_value() {
        let text = "a = 1\r\nname = \"\u{e4}\"\r\n\tb = [1,\n 2]\n";
        let at = text.find("\"\u{e4}").unwrap();
        let error = explain(
            "f.toml",
            text,
            &["--set radar.pri=3".to_owned()],
            vec![
                Found::new(&At::Setting(0), "too long"),
                Found::new(&At::Text(at..at + 4), "odd"),
                Found::new(&At::Text(text.len()..text.len() + 9), "end"),
            ],
        );
        let lines: Vec<String> = error.to_string().lines().map(str::to_owned).collect();
        assert_eq!(
            lines,
            [
                "f.toml:2:8: odd",
                "  2 | name = \"\u{e4}\"",
                "    |        ^^^",
                "f.toml:5:1: end",
                "  5 |",
                "    | ^",
                "--set radar.pri=3: too long",
            ]
        );
        let array = text.find('[').unwrap();
        let spread = explain(
            "f",
            text,
            &[],
            vec![Found::new(&At::Text(array..text.len()), "x")],
        );
        assert_eq!(spread.faults[0].column, Some(6));
        assert!(
            spread.faults[0].excerpt.ends_with(" |      ^^^"),
            "{spread}"
        );
    }
}
