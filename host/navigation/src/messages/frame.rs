//! Where messages begin and end in a stream of bytes, and whether they are whole.
//!
//! | begins with | message | ends with |
//! |---|---|---|
//! | `#` or `%` and a name in capitals | NovAtel ASCII, long or short header | `*`, its CRC-32 in 8 hexadecimal digits, end of line |
//! | AA 44 12 | NovAtel binary, long header (28 bytes or as it says) | its CRC-32, 4 bytes |
//! | AA 44 13 | NovAtel binary, short header (12 bytes) | its CRC-32, 4 bytes |
//! | `$` or `!` | NMEA 0183 | `*`, its checksum in 2 hexadecimal digits, end of line |
//! | `<`, a name in capitals, a blank | NovAtel abbreviated ASCII ([`abbreviated`]) | end of line; it has no checksum |
//!
//! NovAtel's CRC-32 is the reflected polynomial 0xEDB88320 from 0 without a final complement, over the text between `#`
//! and `*`, or over header and body. NMEA's checksum is the exclusive or of the bytes between `$` and `*`. What fits nothing is passed over
//! up to the next beginning: after a line whose CRC is wrong the last beginning within it is tried, so that a line that lost its end costs
//! nothing of the next; after a binary message whose CRC is wrong, whatever follows its first three bytes.
//!
//! Old talkers of NMEA leave the checksum out. A sentence without one is read if it ends with its line, has all the fields of its kind ([`FIELDS`]), and
//! no sentence before had one.

use std::io::{self, BufRead};
use std::ops::Range;

use super::abbreviated;
use crate::account::Wrong;

/// Bytes that a line may have, and that are read at once. The longest records of NovAtel's manual have some kilobytes.
const LONGEST_LINE: usize = 1 << 15;
/// The longest binary message: header, a body of 65535 bytes, CRC.
const LONGEST: usize = 255 + 65_535 + 4;

/// A message whose checksum is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Message<'a> {
    /// NovAtel ASCII: whether its header is the long one, and what is between `#` and `*`.
    Text { long: bool, text: &'a str },
    /// The same of abbreviated ASCII, which nothing checks.
    Abbreviated { long: bool, text: &'a str },
    /// NovAtel binary: header and body.
    Binary {
        long: bool,
        header: &'a [u8],
        body: &'a [u8],
    },
    /// NMEA: what is between `$` and `*`, and whether a checksum followed.
    Nmea { text: &'a str, checked: bool },
}

/// What was met.
pub(crate) enum Met<'a> {
    /// A sound message.
    Message(Message<'a>),
    /// Something wrong, in words.
    Wrong(Wrong, String),
}

/// A place in a stream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    /// Bytes from the beginning.
    pub(crate) byte: u64,
    /// The line, from 1, as long as no binary message was met.
    pub(crate) line: Option<u64>,
}

/// A stream cut into messages.
pub(crate) struct Frames<R> {
    stream: R,
    /// What was read, of which `from` bytes are done with.
    buffer: Vec<u8>,
    from: usize,
    ended: bool,
    at: At,
    /// A record of abbreviated ASCII, rewritten.
    rewritten: String,
    /// Sentences of NMEA have checksums.
    checked: bool,
    /// Bytes that belong to no sound message, ends of lines not counted.
    pub(crate) lost_bytes: u64,
}

/// The CRC of NovAtel.
pub(crate) fn crc(bytes: &[u8]) -> u32 {
    // The usual CRC-32 complements its state at both ends; beginning with the complement of 0 and
    // complementing the result leaves neither.
    let mut hasher = crc32fast::Hasher::new_with_initial(!0);
    hasher.update(bytes);
    !hasher.finalize()
}

/// What begins somewhere, and the bytes that are done with then.
struct Found {
    length: usize,
    /// Nothing, where it only looked so.
    what: Option<What>,
}

enum What {
    Text {
        long: bool,
        text: Range<usize>,
    },
    Binary {
        long: bool,
        header: usize,
        end: usize,
    },
    Abbreviated {
        long: bool,
        text: String,
    },
    Nmea {
        text: Range<usize>,
        checked: bool,
    },
    Wrong(Wrong, String),
}

impl<R: BufRead> Frames<R> {
    pub(crate) fn new(stream: R) -> Self {
        Self {
            stream,
            buffer: Vec::new(),
            from: 0,
            ended: false,
            at: At {
                byte: 0,
                line: Some(1),
            },
            rewritten: String::new(),
            checked: false,
            lost_bytes: 0,
        }
    }

    /// Bytes that are done with.
    pub(crate) fn bytes(&self) -> u64 {
        self.at.byte
    }

    /// Sees that as many bytes are at hand, if the stream has them.
    fn fill(&mut self, length: usize) -> io::Result<()> {
        while !self.ended && self.buffer.len() - self.from < length {
            if self.from > LONGEST {
                self.buffer.drain(..self.from);
                self.from = 0;
            }
            let some = self.stream.fill_buf()?;
            let count = some.len().min(LONGEST);
            self.ended = count == 0;
            self.buffer.extend_from_slice(&some[..count]);
            self.stream.consume(count);
        }
        Ok(())
    }

    /// Goes on by so many bytes.
    fn pass(&mut self, length: usize, lost: bool) {
        let bytes = &self.buffer[self.from..self.from + length];
        let ends = bytes.iter().filter(|&&b| b == b'\n').count() as u64;
        self.at.byte += length as u64;
        self.at.line = self.at.line.map(|line| line + ends);
        if lost {
            let white = bytes.iter().filter(|b| b.is_ascii_whitespace()).count();
            self.lost_bytes += (length - white) as u64;
        }
        self.from += length;
    }

    /// The next that is a message or wrong, and where it begins; none at the end.
    pub(crate) fn next(&mut self) -> io::Result<Option<(At, Met<'_>)>> {
        let Some((at, start, what)) = self.find()? else {
            return Ok(None);
        };
        let seen = &self.buffer[start..];
        let text = |range: Range<usize>| std::str::from_utf8(&seen[range]).unwrap_or_default();
        let message = match what {
            What::Wrong(wrong, what) => return Ok(Some((at, Met::Wrong(wrong, what)))),
            What::Text { long, text: range } => Message::Text {
                long,
                text: text(range),
            },
            What::Binary { long, header, end } => Message::Binary {
                long,
                header: &seen[..header],
                body: &seen[header..end],
            },
            What::Abbreviated { long, text } => {
                self.rewritten = text;
                Message::Abbreviated {
                    long,
                    text: &self.rewritten,
                }
            }
            What::Nmea {
                text: range,
                checked,
            } => Message::Nmea {
                text: text(range),
                checked,
            },
        };
        Ok(Some((at, Met::Message(message))))
    }

    /// The next, and where it begins in the stream and in the buffer, of which it is done with.
    fn find(&mut self) -> io::Result<Option<(At, usize, What)>> {
        loop {
            self.fill(1)?;
            let rest = &self.buffer[self.from..];
            if rest.is_empty() {
                return Ok(None);
            }
            let begins = |b: &u8| matches!(b, b'#' | b'%' | b'$' | b'!' | b'<' | 0xAA);
            let idle = rest.iter().position(begins).unwrap_or(rest.len());
            if idle > 0 {
                self.pass(idle, true);
                continue;
            }
            self.fill(LONGEST)?;
            let rest = &self.buffer[self.from..];
            let found = match rest[0] {
                0xAA => binary(rest),
                b'<' => abbreviated(rest),
                _ => line(rest, self.checked),
            };
            let (at, start) = (self.at, self.from);
            let Some(what) = found.what else {
                self.pass(found.length, true);
                continue;
            };
            self.pass(found.length, matches!(what, What::Wrong(..)));
            self.checked |= matches!(what, What::Nmea { checked: true, .. });
            if let What::Binary { .. } = what {
                // A line has no number after what is no text.
                self.at.line = None;
            }
            return Ok(Some((at, start, what)));
        }
    }
}

fn nothing(length: usize) -> Found {
    Found { length, what: None }
}

fn wrong(length: usize, wrong: Wrong, what: String) -> Found {
    Found {
        length,
        what: Some(What::Wrong(wrong, what)),
    }
}

fn binary(rest: &[u8]) -> Found {
    let (long, header, body) = match *rest {
        [0xAA, 0x44, 0x12, header, _, _, _, _, a, b, ..] if header >= 28 => (
            true,
            usize::from(header),
            usize::from(u16::from_le_bytes([a, b])),
        ),
        [0xAA, 0x44, 0x13, body, ..] => (false, 12, usize::from(body)),
        // The end of the stream came before the length.
        [0xAA, 0x44, 0x12 | 0x13, ..] if rest.len() < 10 => {
            let what = "a binary message cut short within its header".to_owned();
            return wrong(rest.len(), Wrong::Cut, what);
        }
        _ => return nothing(1),
    };
    let end = header + body;
    let Some(&given) = rest.get(end..).and_then(<[u8]>::first_chunk) else {
        let what = format!(
            "a binary message of {} bytes, of which {} are there",
            end + 4,
            rest.len()
        );
        return wrong(3, Wrong::Cut, what);
    };
    let (given, computed) = (u32::from_le_bytes(given), crc(&rest[..end]));
    if given != computed {
        let id = u16::from_le_bytes([rest[4], rest[5]]);
        let what = format!(
            "a binary message {id} of {} bytes whose CRC is {given:08x}, that of its bytes {computed:08x}",
            end + 4
        );
        return wrong(3, Wrong::Checksum, what);
    }
    Found {
        length: end + 4,
        what: Some(What::Binary { long, header, end }),
    }
}

fn abbreviated(rest: &[u8]) -> Found {
    match abbreviated::record(rest) {
        Some((length, long, text)) => Found {
            length,
            what: Some(What::Abbreviated { long, text }),
        },
        None => nothing(1),
    }
}

/// Bytes of a line's text: printable ASCII.
fn line_length(rest: &[u8]) -> usize {
    let most = rest.len().min(LONGEST_LINE);
    let printable = |b: &u8| matches!(b, b' '..=b'~' | b'\t');
    let end = rest[..most].iter().position(|b| !printable(b));
    end.unwrap_or(most)
}

/// Capitals, digits and underscores up to a comma or semicolon.
fn has_name(text: &[u8]) -> bool {
    let name = |b: &u8| b.is_ascii_uppercase() || b.is_ascii_digit() || *b == b'_';
    let length = text.iter().take_while(|b| name(b)).count();
    (3..=32).contains(&length)
        && text[0].is_ascii_uppercase()
        && matches!(text.get(length), None | Some(b',' | b';'))
}

/// So many hexadecimal digits, which are all that follows a `*`.
fn checksum(text: &[u8], digits: usize) -> Option<u32> {
    let text = text.trim_ascii_end();
    let hexadecimal = text.len() == digits && text.iter().all(u8::is_ascii_hexdigit);
    let text = std::str::from_utf8(text).ok()?;
    hexadecimal.then(|| u32::from_str_radix(text, 16).ok())?
}

/// What stands for a line in words: its name, or its first characters.
fn shown(line: &[u8]) -> String {
    let end = line.iter().position(|&b| b == b',' || b == b';');
    let short = &line[..end.unwrap_or(line.len()).min(20)];
    String::from_utf8_lossy(short).into_owned()
}

/// Whether a message may begin at `n` of a line.
fn begins(line: &[u8], n: usize) -> bool {
    matches!(line[n], b'#' | b'%' | b'$' | b'!') && has_name(&line[n + 1..])
}

/// The message that begins with a line.
fn line(rest: &[u8], checked: bool) -> Found {
    let length = line_length(rest);
    let line = &rest[..length];
    if !begins(line, 0) {
        return nothing(1);
    }
    let ends = matches!(rest.get(length), Some(b'\r' | b'\n'));
    let at = |n| message_at(line, n, ends, checked);
    let what = at(0);
    // Another may begin within a line that lost its end: it is met next.
    let inner = match what {
        What::Wrong(..) => (1..length).rev().find(|&n| begins(line, n)),
        _ => None,
    };
    match inner.filter(|&n| !matches!(at(n), What::Wrong(..))) {
        Some(whole) => {
            let what = format!(
                "{} is cut short: another begins within it",
                shown(&line[1..])
            );
            wrong(whole, Wrong::Cut, what)
        }
        None => Found {
            length,
            what: Some(what),
        },
    }
}

fn message_at(line: &[u8], n: usize, ends: bool, checked: bool) -> What {
    match line[n] {
        b'#' | b'%' => novatel_at(line, n),
        _ => nmea_at(line, n, ends, checked),
    }
}

/// The message that begins at `n` of a line and ends with it.
fn novatel_at(line: &[u8], n: usize) -> What {
    let name = shown(&line[n + 1..]);
    let star = line[n..].iter().rposition(|&b| b == b'*');
    let given = star.and_then(|star| Some((n + star, checksum(&line[n + star + 1..], 8)?)));
    let Some((star, given)) = given else {
        let what = format!("{name} is cut short: it does not end in * and 8 hexadecimal digits");
        return What::Wrong(Wrong::Cut, what);
    };
    let computed = crc(&line[n + 1..star]);
    if given != computed {
        let what =
            format!("{name} is damaged: its CRC is {given:08x}, that of its text {computed:08x}");
        return What::Wrong(Wrong::Checksum, what);
    }
    What::Text {
        long: line[n] == b'#',
        text: n + 1..star,
    }
}

/// Fields after the name that sentences have at least.
const FIELDS: [(&str, usize); 6] = [
    ("GGA", 14),
    ("RMC", 11),
    ("ZDA", 6),
    ("GST", 8),
    ("VTG", 8),
    ("HDT", 2),
];

/// A sentence without a checksum, or what is wrong with it. `ends` says that the line has its end, `checked` that others have checksums.
fn unchecked_at(line: &[u8], n: usize, name: &str, ends: bool, checked: bool) -> What {
    let text = &line[n + 1..];
    let fields = text.iter().filter(|&&b| b == b',').count();
    let least = FIELDS
        .iter()
        .find(|(kind, _)| name.len() == 5 && name.ends_with(kind))
        .map_or(1, |&(_, fields)| fields);
    // A checksum that is cut leaves its star, one that is damaged its digits.
    let starred = text.contains(&b'*');
    let whole = fields >= least && ends && !starred;
    match whole {
        true if !checked => What::Nmea {
            text: n + 1..line.len(),
            checked: false,
        },
        true => What::Wrong(
            Wrong::Cut,
            format!("{name} has no checksum, and sentences before have one"),
        ),
        false => What::Wrong(
            Wrong::Cut,
            match fields < least {
                true => format!(
                    "{name} is cut short: it does not end in * and 2 hexadecimal digits, and has {fields} of {least} fields"
                ),
                false => {
                    format!("{name} is cut short: it does not end in * and 2 hexadecimal digits")
                }
            },
        ),
    }
}

/// The sentence that begins at `n` of a line and ends with it.
fn nmea_at(line: &[u8], n: usize, ends: bool, checked: bool) -> What {
    let name = shown(&line[n + 1..]);
    let star = line[n..].iter().rposition(|&b| b == b'*');
    let given = star.and_then(|star| Some((n + star, checksum(&line[n + star + 1..], 2)?)));
    let Some((star, given)) = given else {
        return unchecked_at(line, n, &name, ends, checked);
    };
    let computed = line[n + 1..star].iter().fold(0, |sum, byte| sum ^ byte);
    if given != u32::from(computed) {
        let what = format!(
            "{name} is damaged: its checksum is {given:02X}, that of its text {computed:02X}"
        );
        return What::Wrong(Wrong::Checksum, what);
    }
    What::Nmea {
        text: n + 1..star,
        checked: true,
    }
}
