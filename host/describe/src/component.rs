//! One component of a vector or an interval in a text: `platform.velocity[0]`.

use super::schema::ValueType;

/// Number of components of a key's value that a setting can address; 0 for values without components.
pub(super) fn count(kind: &ValueType) -> usize {
    match kind {
        ValueType::Vector(_) => 3,
        ValueType::Interval(_) => 2,
        _ => 0,
    }
}

/// The text of a vector or an interval with component `index` replaced. The other components keep their units, which a text may state once
/// for those to the left.
///
/// # Errors
/// A message, if the text has no such component.
pub(super) fn replaced(text: &str, index: usize, value: &str) -> Result<String, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    if index >= parts.len() {
        return Err(format!(
            "'{text}' has {} components, from [0] to [{}]: there is no [{index}]",
            parts.len(),
            parts.len() - 1
        ));
    }
    let mut unit = "";
    let mut written = Vec::with_capacity(parts.len());
    for (n, part) in parts.iter().enumerate().rev() {
        let own = unit_of(part);
        unit = if own.is_empty() { unit } else { own };
        let stated = match n == index {
            true => (value.trim(), unit_of(value)),
            false => (*part, own),
        };
        written.push(match stated {
            (text, "") => format!("{text} {unit}").trim_end().to_owned(),
            (text, _) => text.to_owned(),
        });
    }
    written.reverse();
    Ok(written.join(", "))
}

/// Text after the longest prefix that is a number.
fn unit_of(part: &str) -> &str {
    let part = part.trim();
    let ends = (1..=part.len())
        .rev()
        .filter(|&end| part.is_char_boundary(end));
    let end = ends
        .into_iter()
        .find(|&end| part[..end].parse::<f64>().is_ok_and(f64::is_finite));
    part[end.unwrap_or(0)..].trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn component_is_replaced_and_units_are_kept() {
        for (text, index, value, wanted) in [
            ("100, 0, 0 m/s", 0, "95.5 m/s", "95.5 m/s, 0 m/s, 0 m/s"),
            ("1, 2, 3 km", 2, "40 m", "1 km, 2 km, 40 m"),
            ("1, 2, 3 km", 1, "-7", "1 km, -7 km, 3 km"),
            ("1 m, 2 cm,3e-1 km", 0, "5 mm", "5 mm, 2 cm, 3e-1 km"),
            ("0, 1, 0", 1, "0.5", "0, 0.5, 0"),
            ("-4, 4 m", 1, "6 m", "-4 m, 6 m"),
        ] {
            assert_eq!(replaced(text, index, value).unwrap(), wanted, "{text}");
        }
        let message = replaced("-4, 4 m", 2, "6 m").unwrap_err();
        assert!(
            message.contains("2 components, from [0] to [1]"),
            "{message}"
        );
    }
}
