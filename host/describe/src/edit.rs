//! Setting a key's value in a TOML text, with comments, order and spaces unchanged.

use super::error::Location;
use super::tree::{self, Node, Raw, Step, Table};

/// Return `text` with the key at `path` set to `value`: replacing its value, on a new line after the other keys of its
/// section, or with its section at the end. `value` is written as in a setting, without quotes.
///
/// # Errors
/// A message, if the text is not TOML or its form leaves no place for the key.
pub(super) fn set_value(
    text: &str,
    path: &[Step],
    value: &str,
    memory_bytes: u64,
) -> Result<String, String> {
    let root = tree::parse(text, memory_bytes).map_err(|found| found.message)?;
    if let Some(((key, Some(index)), sections)) = path.split_last() {
        let section = inside(&root, sections).map_err(|_| no_place(path))?;
        let value = tree::parse_setting(value, 0).raw;
        let whole = tree::with_component(section.table, key, *index, &value)?;
        let path = [sections, &[(key.clone(), None)]].concat();
        return set_value(text, &path, &whole, memory_bytes);
    }
    let edited = edit(text, &root, path, value)?;
    // The text may use forms that this function does not handle, so that the result is parsed and checked.
    let again = tree::parse(&edited, memory_bytes).map_err(|_| no_place(path))?;
    let found = path.split_last().and_then(|((key, _), sections)| {
        Some(&inside(&again, sections).ok()?.table.get(key)?.1.raw)
    });
    let wanted = tree::parse_setting(&literal(value), 0).raw;
    match (found, wanted) {
        (Some(Raw::Text(got)), Raw::Text(wanted)) if *got == wanted => Ok(edited),
        (Some(Raw::Integer(got)), Raw::Integer(wanted)) if *got == wanted => Ok(edited),
        (Some(Raw::Float(got)), Raw::Float(wanted)) if *got == wanted => Ok(edited),
        _ => Err(no_place(path)),
    }
}

fn no_place(path: &[Step]) -> String {
    format!(
        "cannot determine where to write {} in the text: add the line yourself",
        dotted(path)
    )
}

fn dotted(path: &[Step]) -> String {
    let words = path.iter().map(|(name, index)| match index {
        Some(index) => format!("{name}[{index}]"),
        None => name.clone(),
    });
    words.collect::<Vec<_>>().join(".")
}

/// TOML literal of a value: a number as it is, anything else in quotes.
fn literal(value: &str) -> String {
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() => value.to_owned(),
        _ => format!("\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\"")),
    }
}

/// Section, and the position of its header.
struct Inside<'a> {
    table: &'a Table,
    header: Option<&'a Location>,
}

/// Find the section at `sections`; the error is the number of path steps that exist.
fn inside<'a>(root: &'a Table, sections: &[Step]) -> Result<Inside<'a>, usize> {
    let mut found = Inside {
        table: root,
        header: None,
    };
    for (depth, (name, index)) in sections.iter().enumerate() {
        let node: Option<&Node> = found.table.get(name).map(|(_, node)| node);
        let node = match (node.map(|node| &node.raw), index) {
            (Some(Raw::Array(items)), Some(index)) => items.get(*index),
            _ => node,
        };
        match node {
            Some(Node {
                raw: Raw::Table(table),
                at,
            }) => {
                found = Inside {
                    table,
                    header: Some(at),
                }
            }
            _ => return Err(depth),
        }
    }
    Ok(found)
}

fn edit(text: &str, root: &Table, path: &[Step], value: &str) -> Result<String, String> {
    let Some(((key, _), sections)) = path.split_last() else {
        return Err(no_place(path));
    };
    let value = literal(value);
    let newline = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let section = match inside(root, sections) {
        Ok(section) => section,
        // A missing section is appended. One that can occur several times cannot be created.
        Err(_) if sections.iter().all(|(_, index)| index.is_none()) => {
            let end = if text.is_empty() || text.ends_with('\n') {
                ""
            } else {
                newline
            };
            return Ok(format!(
                "{text}{end}{newline}[{}]{newline}{key} = {value}{newline}",
                dotted(sections)
            ));
        }
        Err(_) => return Err(no_place(path)),
    };
    if let Some((_, node)) = section.table.get(key) {
        return match &node.at {
            Location::Text(range) => Ok(format!(
                "{}{value}{}",
                &text[..range.start],
                &text[range.end..]
            )),
            Location::Setting(_) => Err(no_place(path)),
        };
    }
    let own = section.table.values().filter(|(_, node)| match &node.raw {
        Raw::Table(_) => false,
        Raw::Array(items) => !items.iter().any(|item| matches!(item.raw, Raw::Table(_))),
        _ => true,
    });
    let ends = own.filter_map(|(_, node)| match &node.at {
        Location::Text(range) => Some(range.end),
        Location::Setting(_) => None,
    });
    let last = ends.max().or(match section.header {
        Some(Location::Text(range)) => Some(range.start),
        _ => None,
    });
    // The new line follows the line that contains `last`.
    let at = last.map_or(0, |last| {
        text[last..]
            .find('\n')
            .map_or(text.len(), |more| last + more + 1)
    });
    let begin = if at > 0 && !text[..at].ends_with('\n') {
        newline
    } else {
        ""
    };
    Ok(format!(
        "{}{begin}{key} = {value}{newline}{}",
        &text[..at],
        &text[at..]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a rail\nname = \"rail\"\n\n[radar]  # the box\nkind = \"fmcw\"\nfirst_pulse = \"0 s\"     # guessed\n\
                        \n# how it moved\n[platform]\n\n[[radar.receiver]]\noffset = \"0, 0, 0 m\"\n[[radar.receiver]]\n";

    fn put_at(text: &str, path: &str, value: &str) -> Result<String, String> {
        set_value(text, &tree::parse_path(path).unwrap(), value, 1 << 20)
    }

    #[test]
    fn set_value_changes_only_the_value() {
        let edited = put_at(TEXT, "radar.first_pulse", "9.22 s").unwrap();
        assert_eq!(edited, TEXT.replace("\"0 s\"", "\"9.22 s\""));
        let edited = put_at(TEXT, "radar.receiver[0].offset", "1, 0, 0 mm").unwrap();
        assert_eq!(edited, TEXT.replace("\"0, 0, 0 m\"", "\"1, 0, 0 mm\""));
        let edited = put_at(TEXT, "radar.receiver[0].offset[1]", "2.5 mm").unwrap();
        assert_eq!(
            edited,
            TEXT.replace("\"0, 0, 0 m\"", "\"0 m, 2.5 mm, 0 m\"")
        );
        let dotted = "radar.pri = \"1 s\" # slow\n";
        assert_eq!(
            put_at(dotted, "radar.pri", "2 s").unwrap(),
            "radar.pri = \"2 s\" # slow\n"
        );
    }

    #[test]
    fn new_key_is_added_after_others_of_its_section() {
        let edited = put_at(TEXT, "radar.pri", "1 ms").unwrap();
        assert_eq!(
            edited,
            TEXT.replace("# guessed\n", "# guessed\npri = \"1 ms\"\n")
        );
        let edited = put_at(TEXT, "platform.radius", "21 cm").unwrap();
        assert_eq!(
            edited,
            TEXT.replace("[platform]\n", "[platform]\nradius = \"21 cm\"\n")
        );
        let edited = put_at(TEXT, "radar.receiver[1].offset", "1, 0, 0 mm").unwrap();
        assert_eq!(edited, format!("{TEXT}offset = \"1, 0, 0 mm\"\n"));
        let edited = put_at(TEXT, "recording.range_bias", "0.45 m").unwrap();
        assert_eq!(
            edited,
            format!("{TEXT}\n[recording]\nrange_bias = \"0.45 m\"\n")
        );
        let edited = put_at(TEXT, "seed", "3").unwrap();
        assert_eq!(edited, TEXT.replace("\"rail\"\n", "\"rail\"\nseed = 3\n"));
        let windows = TEXT.replace('\n', "\r\n");
        let edited = put_at(&windows, "radar.pri", "1 ms").unwrap();
        assert_eq!(
            edited,
            windows.replace("# guessed\r\n", "# guessed\r\npri = \"1 ms\"\r\n")
        );
        assert_eq!(
            put_at("[a]\nb = 1", "a.c", "2").unwrap(),
            "[a]\nb = 1\nc = 2\n"
        );
    }

    #[test]
    fn keys_without_a_place_are_refused() {
        for (text, path) in [
            ("a = 1\n", "b[0].c"),
            ("a = 1\n", "a.c"),
            ("a = { b = 1 }\n", "a.c"),
            ("[[a]]\n", "a[1].b"),
            ("a = \n", "a"),
        ] {
            assert!(put_at(text, path, "1 m").is_err(), "{text} {path}");
        }
        // A value in an inline table is replaced like any other.
        assert_eq!(
            put_at("a = { b = 1 }\n", "a.b", "2").unwrap(),
            "a = { b = 2 }\n"
        );
    }
}
