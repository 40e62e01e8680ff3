//! NovAtel's abbreviated ASCII, as `LOG BESTPOS` prints it: the fields of the ASCII record, parted by spaces, without a CRC.
//!
//! ```text
//! <BESTPOS USB1 0 80.0 FINESTEERING 2300 100000.000 02000000 cdba 16000
//! <     SOL_COMPUTED SINGLE 44.25000000000 -121.50000000000 90.0000 -20.0000 WGS84 1.0000 1.0000 1.0000 "0" 0.000 0.000 20 20 20 20 00 00 7f 37
//! ```
//!
//! The body is in the lines that follow and begin with `<` and a blank. A record is rewritten as ASCII and read as such. As nothing checks its bytes, a
//! record whose last line has no end is not read.

/// Fields of the header, the name included: long, and short.
const LONG: usize = 10;
const SHORT: usize = 3;

/// Bytes that lines of a record may have together.
const LONGEST: usize = 1 << 15;

/// A record at the beginning of some bytes: how many it has, whether its header is the long one, and its text as ASCII would have it.
pub(super) fn record(rest: &[u8]) -> Option<(usize, bool, String)> {
    let rest = &rest[..rest.len().min(LONGEST)];
    let (first, mut length) = line(rest)?;
    let header: Vec<&str> = first.split_ascii_whitespace().collect();
    let long = match header.len() {
        LONG => true,
        SHORT => false,
        _ => return None,
    };
    let name = header[0];
    let capital = |b: u8| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_';
    if first.starts_with([' ', '\t'])
        || !(3..=32).contains(&name.len())
        || !name.bytes().all(capital)
    {
        return None;
    }
    let mut body = Vec::new();
    while let Some((text, bytes)) = line(&rest[length..]) {
        if !text.starts_with([' ', '\t']) {
            break;
        }
        body.extend(fields(text));
        length += bytes;
    }
    // Names of ASCII records end in A.
    (!body.is_empty()).then(|| {
        let text = format!("{name}A,{};{}", header[1..].join(","), body.join(","));
        (length, long, text)
    })
}

/// The text of a whole line after its `<`, and the line's bytes with its end.
fn line(rest: &[u8]) -> Option<(&str, usize)> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let text = rest[..end].strip_prefix(b"<")?;
    let text = text.strip_suffix(b"\r").unwrap_or(text);
    let printable = text.iter().all(|b| matches!(b, b' '..=b'~' | b'\t'));
    let text = std::str::from_utf8(text).ok().filter(|_| printable)?;
    Some((text, end + 1))
}

/// Fields of a body; blanks within quotation marks belong to theirs.
fn fields(text: &str) -> Vec<String> {
    let mut quoted = false;
    let mut fields = vec![String::new()];
    for c in text.chars() {
        quoted ^= c == '"';
        match c {
            ' ' | '\t' if !quoted => fields.push(String::new()),
            // A comma would be the end of a field of ASCII.
            ',' => fields
                .last_mut()
                .into_iter()
                .for_each(|field| field.push(' ')),
            c => fields
                .last_mut()
                .into_iter()
                .for_each(|field| field.push(c)),
        }
    }
    fields.retain(|field| !field.is_empty());
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_rewritten_as_ascii() {
        let text = "<BESTPOS USB1 0 80.0 FINESTEERING 2300 1.5 02000000 cdba 16000\r\n<     SOL_COMPUTED \"a b\"\r\n<     7f\n<OK\n";
        let (length, long, ascii) = record(text.as_bytes()).unwrap();
        assert_eq!(length, text.len() - 4);
        assert!(long);
        assert_eq!(
            ascii,
            "BESTPOSA,USB1,0,80.0,FINESTEERING,2300,1.5,02000000,cdba,16000;SOL_COMPUTED,\"a b\",7f"
        );
        for none in [
            "<OK\n",
            "<BESTPOS USB1\n<  x\n",
            "<INSPVAS 1 2\n",
            "<A 1 2\n<  3",
            "",
        ] {
            assert_eq!(record(none.as_bytes()), None, "{none:?}");
        }
    }
}
