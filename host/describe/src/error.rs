//! Faults of a description: what, where, and what to do.

use std::fmt;
use std::ops::Range;

/// Position of a key or value in a description.
#[derive(Clone, Debug, PartialEq)]
pub enum Location {
    /// Byte range of the text.
    Text(Range<usize>),
    /// Index of the setting that overrides the text.
    Setting(usize),
}

/// Fault of a description, not yet rendered with its line.
#[derive(Clone, Debug)]
pub struct Fault {
    /// Position in the text, or of the setting.
    pub at: Location,
    /// Fault, and what to do.
    pub message: String,
}

impl Fault {
    /// Make a fault at a position.
    pub fn new(at: &Location, message: impl Into<String>) -> Self {
        Self {
            at: at.clone(),
            message: message.into(),
        }
    }
}

/// Fault of a description, rendered with its position and line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderedFault {
    /// Position: `FILE:LINE:COLUMN`, or the option, such as `--set KEY=VALUE`.
    pub place: String,
    /// Line in the text, from 1; `None` for a setting.
    pub line: Option<usize>,
    /// Column in characters, from 1; `None` for a setting.
    pub column: Option<usize>,
    /// Source line with carets under the fault; empty for a setting.
    pub excerpt: String,
    /// Fault, and what to do.
    pub message: String,
}

/// Advice at the end of a message if more memory would help.
pub const ALLOW_MORE_MEMORY: &str = "allow more memory";

impl RenderedFault {
    /// Whether more memory would help.
    pub fn wants_memory(&self) -> bool {
        self.message.ends_with(ALLOW_MORE_MEMORY)
    }
}

/// Invalid description, with all faults found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct DescriptionError {
    /// Faults in the order of the text; at least one.
    pub faults: Vec<RenderedFault>,
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

/// Maximum number of faults reported at once; the first ones often cause the others.
const MAX_FAULTS: usize = 8;

/// Maximum number of characters shown of a line before and after the start of the fault.
const SHOWN_BEFORE: usize = 60;
const SHOWN_AFTER: usize = 100;

/// Render faults with their lines. `settings` are the options, such as `--set KEY=VALUE`.
pub fn explain(
    file: &str,
    text: &str,
    settings: &[String],
    mut found: Vec<Fault>,
) -> DescriptionError {
    found.sort_by_key(|found| match &found.at {
        Location::Text(range) => (0, range.start),
        Location::Setting(index) => (1, *index),
    });
    let faults = found.into_iter().take(MAX_FAULTS);
    DescriptionError {
        faults: faults
            .map(|found| match found.at {
                Location::Setting(index) => RenderedFault {
                    place: settings[index].clone(),
                    line: None,
                    column: None,
                    excerpt: String::new(),
                    message: found.message,
                },
                Location::Text(range) => in_text(file, text, &range, found.message),
            })
            .collect(),
    }
}

fn in_text(file: &str, text: &str, range: &Range<usize>, message: String) -> RenderedFault {
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
    // If the fault continues in the next line, only the part in this line is underlined.
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
    RenderedFault {
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
    fn carets_underline_the_value() {
        let text = "a = 1\r\nname = \"\u{e4}\"\r\n\tb = [1,\n 2]\n";
        let at = text.find("\"\u{e4}").unwrap();
        let error = explain(
            "f.toml",
            text,
            &["--set radar.pri=3".to_owned()],
            vec![
                Fault::new(&Location::Setting(0), "too long"),
                Fault::new(&Location::Text(at..at + 4), "odd"),
                Fault::new(&Location::Text(text.len()..text.len() + 9), "end"),
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
            vec![Fault::new(&Location::Text(array..text.len()), "x")],
        );
        assert_eq!(spread.faults[0].column, Some(6));
        assert!(
            spread.faults[0].excerpt.ends_with(" |      ^^^"),
            "{spread}"
        );
    }
}
