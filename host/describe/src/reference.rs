//! Key reference as text.

use std::fmt::Write;

use super::schema::{Presence, Requirement, Schema};

/// Conventions common to all descriptions.
const CONVENTIONS: &str = "Quantities are texts with a unit, such as \"10 GHz\". Several quantities are separated by commas, and a \
    number without a unit takes the unit to its right: \"0, -5, 3 km\". Positions are x, y, z in the scene frame: \
    east, north and up at the origin unless stated otherwise. Body axes are x forward, y left, z up. Relative paths \
    start at the folder of this file.";

impl Schema {
    /// Reference text of all keys, with type, default and description.
    pub fn reference(&self) -> String {
        let mut text = String::new();
        wrap(
            &mut text,
            0,
            &format!("{} {CONVENTIONS}", self.introduction),
        );
        for section in &self.sections {
            let _ = match &*section.path {
                "" => writeln!(text),
                _ => writeln!(text, "\n{}", section.header()),
            };
            let presence = match section.presence {
                Presence::Always => "",
                Presence::Optional => " Optional.",
                Presence::Many => " May be repeated.",
            };
            let condition = condition(
                section.when,
                section.parent().and_then(|path| self.selector_of(path)),
            );
            if !section.doc.is_empty() {
                wrap(
                    &mut text,
                    0,
                    &format!("{}{presence}{condition}", section.doc),
                );
            }
            for key in &section.keys {
                let need = match key.need {
                    Requirement::Required(example) => format!("required, for example {example}"),
                    Requirement::Default(default) => format!("default {default}"),
                    Requirement::Optional(example) => format!("optional, for example {example}"),
                };
                let _ = writeln!(text, "  {} ({need})", key.name);
                let condition = self::condition(key.when, Some(section.selector));
                wrap(&mut text, 6, &format!("{}{condition}", key.doc));
                wrap(&mut text, 6, &format!("[{}]", key.kind.words()));
            }
        }
        text
    }

    fn selector_of(&self, path: &str) -> Option<&'static str> {
        let found = self.sections.iter().find(|section| section.path == path);
        found.map(|section| section.selector)
    }
}

fn condition(when: &[&'static str], selector: Option<&str>) -> String {
    match (when, selector) {
        ([], _) | (_, None) => String::new(),
        (when, Some(selector)) => {
            let words: Vec<String> = when.iter().map(|word| format!("\"{word}\"")).collect();
            format!(" Only with {selector} = {}.", words.join(", "))
        }
    }
}

/// Append `words` in lines of at most 96 characters.
fn wrap(text: &mut String, indent: usize, words: &str) {
    let margin = " ".repeat(indent);
    let mut line = String::new();
    for word in words.split_whitespace() {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > 96 {
            let _ = writeln!(text, "{margin}{line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(text, "{margin}{line}");
}
