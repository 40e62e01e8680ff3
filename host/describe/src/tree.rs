//! Tree of a description's values with their positions, and application of settings.

use std::collections::BTreeMap;

use toml::de::{DeTable, DeValue};

use super::component;
use super::error::{Fault, Location};
use super::memory;

/// TOML value.
#[derive(Clone, Debug)]
pub(crate) enum Raw {
    Text(String),
    /// `None` if too large for 64 bits.
    Integer(Option<i64>),
    Float(f64),
    Flag(bool),
    Date,
    Array(Vec<Node>),
    Table(Table),
}

/// Value with its position.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub raw: Raw,
    pub at: Location,
}

/// Entries of a table with the positions of their keys.
pub(crate) type Table = BTreeMap<String, (Location, Node)>;

impl Raw {
    /// Name of the type with its article, for errors.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Text(_) => "a text",
            Self::Integer(_) => "a whole number",
            Self::Float(_) => "a number",
            Self::Flag(_) => "true or false",
            Self::Date => "a date",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
        }
    }
}

/// Parse TOML within `memory_bytes`; the error is the first syntax error.
pub(crate) fn parse(text: &str, memory_bytes: u64) -> Result<Table, Fault> {
    memory::check(text, memory_bytes)?;
    let place = |span: Option<std::ops::Range<usize>>| Location::Text(span.unwrap_or(0..0));
    let parsed = DeTable::parse(text).map_err(|error| {
        Fault::new(
            &place(error.span()),
            format!("not TOML: {}", error.message()),
        )
    })?;
    Ok(table(parsed.into_inner(), None))
}

/// Parse the value of a setting: TOML if valid, otherwise a string without quotes.
pub(crate) fn parse_setting(text: &str, index: usize) -> Node {
    let at = Location::Setting(index);
    match DeValue::parse(text) {
        Ok(value) => Node {
            raw: raw(value.into_inner(), Some(&at)),
            at,
        },
        Err(_) => Node {
            raw: Raw::Text(text.to_owned()),
            at,
        },
    }
}

/// Convert a table, which is freed meanwhile. Spans count from the start of the text; those of a setting are meaningless, and `setting`
/// replaces them.
fn table(source: DeTable, setting: Option<&Location>) -> Table {
    let place = |span| setting.cloned().unwrap_or(Location::Text(span));
    let entries = source.into_iter().map(|(key, value)| {
        let (key_at, at) = (place(key.span()), place(value.span()));
        let raw = raw(value.into_inner(), setting);
        (key.into_inner().into_owned(), (key_at, Node { raw, at }))
    });
    entries.collect()
}

fn raw(source: DeValue, setting: Option<&Location>) -> Raw {
    match source {
        DeValue::String(text) => Raw::Text(text.into_owned()),
        DeValue::Integer(digits) => {
            Raw::Integer(i64::from_str_radix(digits.as_str(), digits.radix()).ok())
        }
        DeValue::Float(digits) => Raw::Float(digits.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Raw::Flag(flag),
        DeValue::Datetime(_) => Raw::Date,
        DeValue::Array(items) => {
            // A list of its own: one made in place of the parser's would keep its room.
            let mut nodes = Vec::with_capacity(items.len());
            nodes.extend(items.into_iter().map(|item| Node {
                at: setting.cloned().unwrap_or(Location::Text(item.span())),
                raw: raw(item.into_inner(), setting),
            }));
            Raw::Array(nodes)
        }
        DeValue::Table(entries) => Raw::Table(table(entries, setting)),
    }
}

/// Step of a setting's path: a name and, for an array of tables or a component of a value, an index.
pub(crate) type Step = (String, Option<usize>);

/// Parse a dotted path such as `scene.point[1].position`.
pub(crate) fn parse_path(path: &str) -> Result<Vec<Step>, String> {
    path.split('.')
        .map(|word| {
            let (name, index) = match word.split_once('[') {
                None => (word, None),
                Some((name, rest)) => {
                    let index = rest
                        .strip_suffix(']')
                        .and_then(|digits| digits.parse().ok());
                    let Some(index) = index else {
                        return Err(format!("'{word}': write an index as {name}[0]"));
                    };
                    (name, Some(index))
                }
            };
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || !name.chars().all(plain) {
                return Err(format!(
                    "'{path}' is not a key: write names separated by dots, such as radar.pri or \
                     scene.point[0].position"
                ));
            }
            Ok((name.to_owned(), index))
        })
        .collect()
}

/// Apply a setting to the tree, creating missing sections.
pub(crate) fn apply_setting(root: &mut Table, path: &[Step], value: Node) -> Result<(), Fault> {
    let at = value.at.clone();
    let fail = |message: String| Err(Fault::new(&at, message));
    let Some(((name, component), sections)) = path.split_last() else {
        return fail("expected a key".to_owned());
    };
    let mut table = root;
    for (section, index) in sections {
        let empty = || Node {
            raw: Raw::Table(Table::new()),
            at: at.clone(),
        };
        let entry = table.entry(section.clone()).or_insert_with(|| {
            let node = match index {
                None => empty(),
                Some(_) => Node {
                    raw: Raw::Array(Vec::new()),
                    at: at.clone(),
                },
            };
            (at.clone(), node)
        });
        let node = match (&mut entry.1, index) {
            (node, None) => node,
            (
                Node {
                    raw: Raw::Array(items),
                    ..
                },
                Some(index),
            ) => {
                if *index == items.len() {
                    items.push(empty());
                }
                let count = items.len();
                match items.get_mut(*index) {
                    Some(item) => item,
                    None => {
                        return fail(format!(
                            "[[{section}]] occurs {count} times: write an index from 0 to {count}"
                        ));
                    }
                }
            }
            _ => return fail(format!("'{section}' occurs once: remove the index")),
        };
        table = match &mut node.raw {
            Raw::Table(table) => table,
            Raw::Array(_) => {
                return fail(format!("'{section}' can be repeated: write {section}[0]"));
            }
            _ => return fail(format!("'{section}' is not a section")),
        };
    }
    let value = match component {
        None => value,
        Some(index) => Node {
            raw: Raw::Text(
                with_component(table, name, *index, &value.raw)
                    .map_err(|message| Fault::new(&at, message))?,
            ),
            at: at.clone(),
        },
    };
    table.insert(name.clone(), (at, value));
    Ok(())
}

/// Value of a setting as text.
fn text_of(value: &Raw) -> Option<String> {
    match value {
        Raw::Text(text) => Some(text.clone()),
        Raw::Integer(Some(number)) => Some(number.to_string()),
        Raw::Float(number) => Some(format!("{number:?}")),
        _ => None,
    }
}

/// Text of the vector or interval `name` with one component replaced.
pub(crate) fn with_component(
    table: &Table,
    name: &str,
    index: usize,
    value: &Raw,
) -> Result<String, String> {
    let Some((_, Node { raw, .. })) = table.get(name) else {
        return Err(format!(
            "component {index} of '{name}' is set, but the key has no value: write all of its components first"
        ));
    };
    match (raw, text_of(value)) {
        (Raw::Text(text), Some(value)) => component::replaced(text, index, &value),
        (Raw::Text(_), None) => Err(format!(
            "expected a quantity for component {index} of '{name}', found {}",
            value.name()
        )),
        _ => Err(format!(
            "'{name}' is {} and has no components: remove the index",
            raw.name()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_applied_at_their_path() {
        let mut root = parse("a = 1\n[[s.p]]\nx = 2\n", 1 << 20).unwrap();
        let mut set = |path: &str, value: &str| {
            let steps =
                parse_path(path).map_err(|message| Fault::new(&Location::Setting(0), message))?;
            apply_setting(&mut root, &steps, parse_setting(value, 0))
        };
        set("a", "5 km").unwrap();
        set("s.p[0].x", "3").unwrap();
        set("s.p[1].x", "[1, 2]").unwrap();
        set("new.deep.key", "true").unwrap();
        set("s.p[0].v", "1, 2, 3 m").unwrap();
        set("s.p[0].v[1]", "5 km").unwrap();
        set("s.p[0].v[0]", "7").unwrap();
        for (path, part) in [
            ("s.p.x", "write p[0]"),
            ("s.p[5].x", "from 0 to 2"),
            ("s[0].p", "remove the index"),
            ("a.b", "not a section"),
            ("a[3]", "no [3]"),
            ("b[0]", "write all of its components first"),
            ("new[0]", "has no components"),
            ("s.p[x].x", "write an index as p[0]"),
            ("", "is not a key"),
            ("a..b", "is not a key"),
        ] {
            let error = set(path, "1").unwrap_err();
            assert!(error.message.contains(part), "{path}: {}", error.message);
        }
        assert!(matches!(&root["a"].1.raw, Raw::Text(text) if text == "5 km"));
        let Raw::Table(s) = &root["s"].1.raw else {
            panic!("no table")
        };
        let Raw::Array(points) = &s["p"].1.raw else {
            panic!("no array")
        };
        assert_eq!(points.len(), 2);
        let Raw::Table(first) = &points[0].raw else {
            panic!("no table")
        };
        assert!(matches!(first["x"].1.raw, Raw::Integer(Some(3))));
        assert!(matches!(&first["v"].1.raw, Raw::Text(text) if text == "7 m, 5 km, 3 m"));
        assert!(root.contains_key("new"));
    }
}
