//! Conversion of a TOML value to the type of its key.

use std::ops::RangeInclusive;

use super::error::Fault;
use super::schema::{Key, ValueType};
use super::tree::{Node, Raw};
use super::values::Value;
use subaperture_model::nearest::nearest;
use subaperture_model::units::{Dimension, example_row, parse_row};

/// Convert and check the value of a key.
pub(super) fn value(key: &Key, node: &Node) -> Result<Value, Fault> {
    match key.kind {
        ValueType::Text | ValueType::Path => some_text(key, node),
        ValueType::Paths => texts(key, node),
        ValueType::Choice(words) => choice(key, node, words).map(Value::Text),
        ValueType::Choices(words) => choices(key, node, words).map(Value::Texts),
        ValueType::Flag => match node.raw {
            Raw::Flag(flag) => Ok(Value::Flag(flag)),
            _ => Err(wrong(key, node, "true or false")),
        },
        ValueType::Count(from, to) => count(key, node, from..=to),
        ValueType::Quantity(dimension, bounds) => {
            let number = quantity(key, node, dimension)?;
            match bounds.refuse(number) {
                None => Ok(Value::Number(number)),
                Some(wanted) => Err(fail(node, format!("'{}' must be {wanted}", key.name))),
            }
        }
        ValueType::Vector(dimension) => numbers(key, node, &[dimension; 3]).map(Value::Numbers),
        ValueType::Interval(dimension) => {
            let ends = numbers(key, node, &[dimension; 2])?;
            if ends[0] < ends[1] {
                Ok(Value::Numbers(ends))
            } else {
                Err(fail(
                    node,
                    format!(
                        "'{}': expected the lower limit before the upper one",
                        key.name
                    ),
                ))
            }
        }
        ValueType::Rows(dimensions, least) => rows(key, node, dimensions, least),
    }
}

fn fail(node: &Node, message: String) -> Fault {
    Fault::new(&node.at, message)
}

/// Error for a value of the wrong type.
fn wrong(key: &Key, node: &Node, wanted: &str) -> Fault {
    fail(
        node,
        format!(
            "'{}' is {}, expected {wanted}: write for example {} = {}",
            key.name,
            node.raw.name(),
            key.name,
            key.example()
        ),
    )
}

/// Non-empty string.
fn some_text(key: &Key, node: &Node) -> Result<Value, Fault> {
    match &node.raw {
        Raw::Text(text) if text.trim().is_empty() => Err(fail(
            node,
            format!(
                "'{}' is empty: write for example {}",
                key.name,
                key.example()
            ),
        )),
        Raw::Text(text) => Ok(Value::Text(text.clone())),
        _ => Err(wrong(key, node, "a text in quotes")),
    }
}

/// One or more non-empty strings.
fn texts(key: &Key, node: &Node) -> Result<Value, Fault> {
    let one = |node: &Node| match &node.raw {
        Raw::Text(text) if !text.trim().is_empty() => Ok(text.clone()),
        _ => Err(fail(
            node,
            format!(
                "'{}': expected non-empty texts: write for example {}",
                key.name,
                key.example()
            ),
        )),
    };
    match &node.raw {
        Raw::Array(items) if !items.is_empty() => items
            .iter()
            .map(one)
            .collect::<Result<_, _>>()
            .map(Value::Texts),
        Raw::Text(_) => one(node).map(|text| Value::Texts(vec![text])),
        _ => Err(wrong(key, node, "a text in quotes, or an array of them,")),
    }
}

/// One of the permitted words.
fn choice(key: &Key, node: &Node, words: &[&str]) -> Result<String, Fault> {
    match &node.raw {
        Raw::Text(text) if words.contains(&text.as_str()) => Ok(text.clone()),
        Raw::Text(text) => {
            let meant = nearest(text, words.iter().copied())
                .map(|word| format!(" (did you mean \"{word}\"?)"))
                .unwrap_or_default();
            Err(fail(
                node,
                format!(
                    "'{}': unknown value \"{text}\"{meant}: choose {}",
                    key.name,
                    key.kind.words()
                ),
            ))
        }
        _ => Err(wrong(key, node, "a word in quotes")),
    }
}

/// One or more of the permitted words.
fn choices(key: &Key, node: &Node, words: &[&str]) -> Result<Vec<String>, Fault> {
    match &node.raw {
        Raw::Array(items) => items.iter().map(|item| choice(key, item, words)).collect(),
        Raw::Text(_) => Ok(vec![choice(key, node, words)?]),
        _ => Err(wrong(key, node, "a word in quotes, or an array of them,")),
    }
}

/// Integer within bounds.
fn count(key: &Key, node: &Node, bounds: RangeInclusive<u64>) -> Result<Value, Fault> {
    match node.raw {
        Raw::Integer(Some(count)) => match u64::try_from(count) {
            Ok(count) if bounds.contains(&count) => Ok(Value::Count(count)),
            _ => Err(fail(
                node,
                format!("'{}' is {count}, expected a {}", key.name, key.kind.words()),
            )),
        },
        Raw::Integer(None) => Err(fail(
            node,
            format!(
                "'{}' is too large: expected a {}",
                key.name,
                key.kind.words()
            ),
        )),
        _ => Err(wrong(key, node, "a whole number without a unit")),
    }
}

/// Number in the base unit of its dimension.
fn quantity(key: &Key, node: &Node, dimension: Dimension) -> Result<f64, Fault> {
    match (&node.raw, dimension) {
        (Raw::Integer(Some(n)), Dimension::Ratio) => Ok(*n as f64),
        (Raw::Float(number), Dimension::Ratio) if number.is_finite() => Ok(*number),
        (Raw::Text(text), _) => dimension.parse(text).map_err(|what| fail(node, what)),
        (Raw::Integer(_) | Raw::Float(_), _) => Err(unitless(key, node, &[dimension])),
        _ => Err(wrong(key, node, dimension.name())),
    }
}

/// At least `least` rows of quantities.
fn rows(key: &Key, node: &Node, dimensions: &[Dimension], least: usize) -> Result<Value, Fault> {
    match &node.raw {
        Raw::Array(items) if items.len() >= least => {
            let rows = items.iter().map(|item| numbers(key, item, dimensions));
            rows.collect::<Result<_, _>>().map(Value::Rows)
        }
        Raw::Array(items) => Err(fail(
            node,
            format!(
                "'{}' has {} rows, expected {least} or more",
                key.name,
                items.len()
            ),
        )),
        _ => Err(wrong(key, node, "an array of texts")),
    }
}

/// String with a row of quantities.
fn numbers(key: &Key, node: &Node, dimensions: &[Dimension]) -> Result<Vec<f64>, Fault> {
    match &node.raw {
        Raw::Text(text) => {
            parse_row(text, dimensions).map_err(|message| Fault::new(&node.at, message))
        }
        _ => Err(unitless(key, node, dimensions)),
    }
}

/// Error for a number or an array without units.
fn unitless(key: &Key, node: &Node, dimensions: &[Dimension]) -> Fault {
    Fault::new(
        &node.at,
        format!(
            "'{}' is {} without a unit: write a text such as {}",
            key.name,
            node.raw.name(),
            example_row(dimensions)
        ),
    )
}
