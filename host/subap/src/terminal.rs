//! Escaping of text for display on a terminal.

use std::borrow::Cow;

/// Replace control characters except line feeds and tabs by escapes such as `\u{1b}`.
///
/// Names come from files, and a file must not be able to control the terminal.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    let is_command = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(is_command) {
        return text.into();
    }
    let shown = text.chars().map(|c| match is_command(c) {
        true => c.escape_default().to_string(),
        false => c.to_string(),
    });
    shown.collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(printable("two\nlines of \u{b5}m"), "two\nlines of \u{b5}m");
        assert_eq!(printable("a\u{1b}[2Jb\r\u{9b}"), "a\\u{1b}[2Jb\\r\\u{9b}");
    }
}
