//! Files of the samples: one, several, or a numbered sequence.

/// Maximum number of files in one pattern.
const MOST: u64 = 100_000;

/// Names in the pattern `text`: `stop{01..64}.bin` means `stop01.bin`, `stop02.bin`, ..., as in shells, with as many
/// digits as the wider end if one begins with 0. Any other text is a single name.
///
/// # Errors
/// A message, for a pattern of too many files.
pub(super) fn expand(text: &str) -> Result<Vec<String>, String> {
    let Some((before, first, last, after)) = pattern(text) else {
        return Ok(vec![text.to_owned()]);
    };
    let numbers = |digits: &str| {
        digits
            .parse::<u64>()
            .map_err(|_| format!("'{digits}' is too large a number"))
    };
    let (from, to) = (numbers(first)?, numbers(last)?);
    if from.abs_diff(to) >= MOST {
        return Err(format!(
            "'{text}': expected a pattern of at most {MOST} files, found {}",
            from.abs_diff(to) + 1
        ));
    }
    let padded = [first, last]
        .iter()
        .any(|digits| digits.len() > 1 && digits.starts_with('0'));
    let width = if padded {
        first.len().max(last.len())
    } else {
        1
    };
    let name = |number: u64| format!("{before}{number:0width$}{after}");
    Ok(if from <= to {
        (from..=to).map(name).collect()
    } else {
        (to..=from).rev().map(name).collect()
    })
}

/// Text before the first `{A..B}` of two numbers, both numbers, and the text after it.
fn pattern(text: &str) -> Option<(&str, &str, &str, &str)> {
    text.match_indices('{').find_map(|(open, _)| {
        let (inner, after) = text[open + 1..].split_once('}')?;
        let (first, last) = inner.split_once("..")?;
        let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        (digits(first) && digits(last)).then_some((&text[..open], first, last, after))
    })
}

#[cfg(test)]
mod tests {
    use super::expand;

    #[test]
    fn patterns_expand_as_in_shells() {
        assert_eq!(expand("a.bin").unwrap(), ["a.bin"]);
        assert_eq!(
            expand("s{8..11}.bin").unwrap(),
            ["s8.bin", "s9.bin", "s10.bin", "s11.bin"]
        );
        assert_eq!(expand("s{08..10}").unwrap(), ["s08", "s09", "s10"]);
        assert_eq!(expand("d/{3..1}/x").unwrap(), ["d/3/x", "d/2/x", "d/1/x"]);
        for plain in ["{a..b}", "{1..}", "{1,2}", "a{1..2", "{}"] {
            assert_eq!(expand(plain).unwrap(), [plain]);
        }
        assert!(expand("{0..999999999}").unwrap_err().contains("at most"));
        assert!(expand("{0..99999999999999999999999}").is_err());
    }
}
