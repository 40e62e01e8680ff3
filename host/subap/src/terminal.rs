//! Escaping of text for display on a terminal.

use std::borrow::Cow;

/// `text` without control characters but ends of lines and tabs;
/// they are shown as `\u{1b}`: names come from files,
/// and no file is to write commands to a terminal.
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
    fn names_write_no_commands_to_a_terminal() {
        assert_eq!(printable("two\nlines of \u{b5}m"), "two\nlines of \u{b5}m");
        assert_eq!(printable("a\u{1b}[2Jb\r\u{9b}"), "a\\u{1b}[2Jb\\r\\u{9b}");
    }
}
