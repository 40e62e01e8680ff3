//! NovAtel abbreviated ASCII, the output of `LOG BESTPOS`: the fields of the ASCII record, separated by spaces, without a CRC.
//!
//! ```text
//! <BESTPOS USB1 0 80.0 FINESTEERING 2300 100000.000 02000000 cdba 16000
//! <     SOL_COMPUTED SINGLE 44.25000000000 -121.50000000000 90.0000 -20.0000 WGS84 1.0000 1.0000 1.0000 "0" 0.000 0.000 20 20 20 20 00 00 7f 37
//! ```
//!
//! The body follows in lines that begin with `<` and a blank. A record is rewritten as ASCII and read as such. As there is no CRC, a record whose
//! last line has no line end is not read.

/// Numbers of fields of long and short headers, with the name.
const LONG: usize = 10;
const SHORT: usize = 3;

/// Largest length of a record, bytes.
const LONGEST: usize = 1 << 15;

/// Record at the start of `rest`: its length in bytes, whether its header is long, and its text rewritten as NovAtel ASCII.
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

/// Text of a complete line after its `<`, and the length of the line with its end, bytes.
fn line(rest: &[u8]) -> Option<(&str, usize)> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let text = rest[..end].strip_prefix(b"<")?;
    let text = text.strip_suffix(b"\r").unwrap_or(text);
    let printable = text.iter().all(|b| matches!(b, b' '..=b'~' | b'\t'));
    let text = std::str::from_utf8(text).ok().filter(|_| printable)?;
    Some((text, end + 1))
}

/// Fields of a body. Blanks within quotation marks do not separate fields.
fn fields(text: &str) -> Vec<String> {
    let mut quoted = false;
    let mut fields = vec![String::new()];
    for c in text.chars() {
        quoted ^= c == '"';
        match c {
            ' ' | '\t' if !quoted => fields.push(String::new()),
            // A comma would end a field of the rewritten ASCII.
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
    fn abbreviated_records_are_rewritten_as_ascii() {
        let text = "<BESTPOS USB1 0 80.0 FINESTEERING 2300 1.5 02000000 cdba 16000\r\n<     SOL_COMPUTED \"a b\"\r\n<     7f\n<OK\n";
        let (length, long, ascii) = record(text.as_bytes()).unwrap();
        assert_eq!(length, text.len() - 4);
        assert!(long);
        assert_eq!(
            ascii,
            "BESTPOSA,USB1,0,80.0,FINESTEERING,2300,1.5,02000000,cdba,16000;SOL_COMPUTED,\"a b\",7f"
        );
        for invalid in [
            "<OK\n",
            "<BESTPOS USB1\n<  x\n",
            "<INSPVAS 1 2\n",
            "<A 1 2\n<  3",
            "",
        ] {
            assert_eq!(record(invalid.as_bytes()), None, "{invalid:?}");
        }
    }
}
