//! Check of the tree against the schema: names, types, units, bounds, missing keys.

use std::collections::BTreeMap;

use super::error::{Fault, Location};
use super::of_kind::value;
use super::schema::{Key, Presence, Requirement, Schema, Section, ValueType};
use super::tree::{Node, Raw, Table, parse_setting};
use super::values::{LocatedValue, Value, Values};
use subaperture_model::nearest::nearest;

/// Maximum number of unknown keys examined; far more than are reported.
const MAX_FOUND: usize = 1000;

/// Values of a section and of all sections within it. Faults are added to `faults`; the values are complete only if
/// there are none.
pub(crate) fn resolve(
    schema: &Schema,
    section: &Section,
    table: &Table,
    at: &Location,
    faults: &mut Vec<Fault>,
) -> Values {
    let selected = selected(section, table);
    let applies = |when: &[&str]| applies(when, selected.as_deref());
    let children: Vec<&Section> = schema.within(&section.path).collect();

    check_names(schema, section, table, selected.as_deref(), faults);
    let mut values = Values {
        at: at.clone(),
        keys: BTreeMap::new(),
        within: BTreeMap::new(),
    };
    for key in &section.keys {
        if applies(key.when) != Some(true) {
            continue;
        }
        let checked = match table.get(key.name) {
            Some((_, node)) => value(key, node).map(|value| (value, node.at.clone())),
            None => match key.need {
                Requirement::Optional(_) => continue,
                need => default_value(section, key, need, at),
            },
        };
        match checked {
            Ok((value, at)) => {
                values.keys.insert(key.name, LocatedValue { value, at });
            }
            Err(found) => faults.push(found),
        }
    }
    for child in children {
        let given = table
            .get(child.name())
            .filter(|(_, node)| !is_misspelt_key(section, child.name(), node))
            .map(|(key_at, node)| (key_at, node));
        if given.is_none() && applies(child.when) != Some(true) {
            continue;
        }
        let found = sections(schema, child, given, at, faults);
        values.within.insert(child.name().to_owned(), found);
    }
    values
}

/// Whether a key or section restricted to the selector values `when` applies; `None` if the selector itself is invalid.
fn applies(when: &[&str], selected: Option<&str>) -> Option<bool> {
    if when.is_empty() {
        return Some(true);
    }
    selected.map(|value| when.contains(&value))
}

/// Report the faults of the names in a section's table.
fn check_names(
    schema: &Schema,
    section: &Section,
    table: &Table,
    selected: Option<&str>,
    faults: &mut Vec<Fault>,
) {
    let children: Vec<&Section> = schema.within(&section.path).collect();
    for (name, (key_at, node)) in table {
        let when = match (
            section.key(name),
            children.iter().find(|child| child.name() == name),
        ) {
            (Some(key), _) => key.when,
            (None, Some(child)) if !is_misspelt_key(section, name, node) => child.when,
            (None, _) => {
                // Suggestions for a million unknown keys would take too long.
                if faults.len() < MAX_FOUND {
                    faults.push(Fault::new(key_at, unknown(schema, section, name, node)));
                }
                continue;
            }
        };
        if applies(when, selected) == Some(false) {
            faults.push(Fault::new(
                key_at,
                format!(
                    "'{name}' does not apply to {} = \"{}\": remove it, or choose {}",
                    section.selector,
                    selected.unwrap_or_default(),
                    ValueType::Choice(when).words()
                ),
            ));
        }
    }
}

/// Value of a key that is not given.
fn default_value(
    section: &Section,
    key: &Key,
    need: Requirement,
    at: &Location,
) -> Result<(Value, Location), Fault> {
    match need {
        Requirement::Default(text) => {
            let node = parse_setting(text, 0);
            let value = value(key, &node).map_err(|found| found.message);
            Ok((value.expect("defaults are valid"), at.clone()))
        }
        Requirement::Required(example) | Requirement::Optional(example) => Err(Fault::new(
            at,
            format!(
                "{} needs '{}', {}: write for example {} = {example}",
                section.header(),
                key.name,
                first_sentence(key.doc),
                key.name
            ),
        )),
    }
}

/// Value of the selector, given or default; `None` if it has neither or is invalid.
fn selected(section: &Section, table: &Table) -> Option<String> {
    let key = section.key(section.selector)?;
    let checked = match (table.get(key.name), key.need) {
        (Some((_, node)), _) => value(key, node),
        (None, Requirement::Default(text)) => value(key, &parse_setting(text, 0)),
        (None, _) => return None,
    };
    match checked {
        Ok(Value::Text(text)) => Some(text),
        _ => None,
    }
}

/// All sections with this path.
fn sections(
    schema: &Schema,
    section: &Section,
    given: Option<(&Location, &Node)>,
    parent_at: &Location,
    faults: &mut Vec<Fault>,
) -> Vec<Values> {
    let one = |node: &Node, faults: &mut Vec<Fault>| match &node.raw {
        Raw::Table(table) => Some(resolve(schema, section, table, &node.at, faults)),
        other => {
            faults.push(Fault::new(
                &node.at,
                format!(
                    "'{}' is {}: write a section {}",
                    section.name(),
                    other.name(),
                    section.header()
                ),
            ));
            None
        }
    };
    match (section.presence, given) {
        (Presence::Always, None) => {
            vec![resolve(schema, section, &Table::new(), parent_at, faults)]
        }
        (_, None) => Vec::new(),
        (
            Presence::Many,
            Some((
                _,
                Node {
                    raw: Raw::Array(items),
                    ..
                },
            )),
        ) => items.iter().filter_map(|item| one(item, faults)).collect(),
        (Presence::Many, Some((key_at, node))) => {
            faults.push(Fault::new(
                if matches!(node.raw, Raw::Table(_)) {
                    key_at
                } else {
                    &node.at
                },
                format!(
                    "'{}' can be repeated: write {} with two brackets",
                    section.name(),
                    section.header()
                ),
            ));
            Vec::new()
        }
        (_, Some((_, node))) => one(node, faults).into_iter().collect(),
    }
}

/// Whether the name of a subsection is a misspelt key of this section: `pulse = 32`, where both `pulses` and
/// `[radar.pulse]` are known.
fn is_misspelt_key(section: &Section, name: &str, node: &Node) -> bool {
    let keys = section.keys.iter().map(|key| key.name);
    !matches!(node.raw, Raw::Table(_) | Raw::Array(_)) && nearest(name, keys).is_some()
}

fn unknown(schema: &Schema, section: &Section, name: &str, node: &Node) -> String {
    let own = section.keys.iter().map(|key| key.name);
    let inner = schema
        .within(&section.path)
        .map(|within| within.name())
        .filter(|inner| *inner != name);
    if let Some(meant) = nearest(name, own.clone().chain(inner)) {
        return format!("unknown key '{name}': did you mean '{meant}'?");
    }
    // The key may belong to another section.
    let has = |other: &&Section| other.key(name).is_some() && !matches!(node.raw, Raw::Table(_));
    let elsewhere: Vec<String> = schema
        .sections
        .iter()
        .filter(has)
        .map(Section::header)
        .collect();
    if !elsewhere.is_empty() {
        return format!(
            "unknown key '{name}' in {}: it belongs to {}",
            section.header(),
            elsewhere.join(" or ")
        );
    }
    let known: Vec<&str> = own
        .chain(schema.within(&section.path).map(Section::name))
        .collect();
    format!(
        "unknown key '{name}': {} has {}",
        section.header(),
        known.join(", ")
    )
}

fn first_sentence(doc: &str) -> String {
    let sentence = doc.split(['.', ':', ';']).next().unwrap_or_default();
    let mut letters = sentence.chars();
    let first: String = letters
        .next()
        .into_iter()
        .flat_map(char::to_lowercase)
        .collect();
    first + letters.as_str()
}
