//! Answers of an analyser: definite-length blocks, numbers, entries of the error queue.

use std::ops::Range;

use super::fault::{Fault, FaultKind};
use super::settings::ByteOrder;

/// Longest line of text that is shown in a message, characters.
const SHOWN: usize = 60;

/// Text for a message, with characters that are not printable escaped.
pub fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut shown: String = text.chars().take(SHOWN).collect();
    if text.chars().count() > SHOWN {
        shown.push_str("...");
    }
    format!("'{}'", shown.escape_debug())
}

fn malformed<T>(message: String) -> Result<T, Fault> {
    Err(Fault::new(FaultKind::Malformed, message))
}

/// Place of the data of a definite-length block (IEEE 488.2, `#` digits length data) at the start of `bytes`, which may end before it. `None` if more
/// bytes are needed.
///
/// # Errors
/// [`FaultKind::Malformed`] if this is no block, [`FaultKind::TooLong`] for more than `most_bytes`.
pub fn block(bytes: &[u8], most_bytes: usize) -> Result<Option<Range<usize>>, Fault> {
    let (Some(&mark), digits) = (bytes.first(), bytes.get(1)) else {
        return Ok(None);
    };
    let is_count = |digit: &u8| (b'1'..=b'9').contains(digit);
    if mark != b'#' || !digits.is_none_or(is_count) {
        let line = bytes.split(|&byte| byte == b'\n').next();
        return malformed(format!(
            "expected a block of the form #<digits><length><data>, found {}",
            match line.unwrap_or_default() {
                b"" | b"\r" => "an empty answer".to_owned(),
                line => shown(line),
            }
        ));
    }
    let Some(&digits) = digits else {
        return Ok(None);
    };
    let start = 2 + usize::from(digits - b'0');
    let header = &bytes[2..start.min(bytes.len())];
    if !header.iter().all(u8::is_ascii_digit) {
        return malformed(format!(
            "expected the digits of a block's length, found {}",
            shown(header)
        ));
    }
    if bytes.len() < start {
        return Ok(None);
    }
    // At most 9 digits.
    let length = header
        .iter()
        .fold(0, |sum, digit| 10 * sum + usize::from(digit - b'0'));
    if length > most_bytes {
        let message = format!("expected a block of at most {most_bytes} bytes, found {length}");
        return Err(Fault::new(FaultKind::TooLong, message));
    }
    Ok(Some(start..start + length))
}

/// Numbers of a block of float64.
///
/// # Errors
/// [`FaultKind::Malformed`] if the length is no multiple of 8 bytes.
pub fn numbers(data: &[u8], order: ByteOrder) -> Result<Vec<f64>, Fault> {
    let (words, rest) = data.as_chunks::<8>();
    if !rest.is_empty() {
        return malformed(format!(
            "expected a block of float64, a multiple of 8 bytes, found {} bytes",
            data.len()
        ));
    }
    let number = match order {
        ByteOrder::Little => f64::from_le_bytes,
        ByteOrder::Big => f64::from_be_bytes,
    };
    Ok(words.iter().copied().map(number).collect())
}

/// Finite number of a text.
///
/// # Errors
/// [`FaultKind::Malformed`] with the text.
pub fn number(text: &str) -> Result<f64, Fault> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => malformed(format!(
            "expected a number, found {}",
            shown(text.as_bytes())
        )),
    }
}

/// Entry of the error queue: its code and its text.
///
/// # Errors
/// [`FaultKind::Malformed`] with the text.
pub fn queue_entry(text: &str) -> Result<(i32, String), Fault> {
    let (code, rest) = text.split_once(',').unwrap_or((text, ""));
    let Ok(code) = code.trim().parse::<i32>() else {
        return malformed(format!(
            "expected an error code and its text, found {}",
            shown(text.as_bytes())
        ));
    };
    let shown = shown(rest.trim().trim_matches('"').as_bytes());
    Ok((code, shown.trim_matches('\'').to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_read_piece_by_piece() {
        let whole = b"#212abcdefghijkl\n";
        for length in 0..4 {
            assert_eq!(block(&whole[..length], 12), Ok(None), "{length}");
        }
        for length in 4..whole.len() {
            assert_eq!(block(&whole[..length], 12), Ok(Some(4..16)), "{length}");
        }
        let error = block(whole, 11).unwrap_err();
        assert_eq!(error.kind, FaultKind::TooLong);
        for (bytes, part) in [
            (&b"\n"[..], "an empty answer"),
            (b"NO DATA\n1", "'NO DATA'"),
            (b"#0abc\n", "'#0abc'"),
            (b"#2x1a", "'x1'"),
        ] {
            let error = block(bytes, 12).unwrap_err();
            assert_eq!(error.kind, FaultKind::Malformed);
            assert!(error.message.contains(part), "{error}");
        }
    }

    #[test]
    fn numbers_have_either_byte_order() {
        let mut bytes = 1.5f64.to_be_bytes().to_vec();
        bytes.extend((-2.0f64).to_be_bytes());
        assert_eq!(numbers(&bytes, ByteOrder::Big), Ok(vec![1.5, -2.0]));
        bytes.reverse();
        assert_eq!(numbers(&bytes, ByteOrder::Little), Ok(vec![-2.0, 1.5]));
        assert!(numbers(&bytes[1..], ByteOrder::Big).is_err());
        assert_eq!(number(" +1.00E+009"), Ok(1e9));
        assert!(number("9.9E999").is_err() && number("").is_err());
    }

    #[test]
    fn entries_of_the_error_queue_have_code_and_text() {
        let undefined = (-113, "Undefined header;\\tSENS".to_owned());
        assert_eq!(
            queue_entry("-113,\"Undefined header;\tSENS\""),
            Ok(undefined)
        );
        assert_eq!(queue_entry("+0").unwrap().0, 0);
        assert!(queue_entry("no error").is_err());
    }
}
