//! Framing of messages in a byte stream, with check of their checksums.
//!
//! | begins with | message | ends with |
//! |---|---|---|
//! | `#` or `%` and a name in capitals | NovAtel ASCII, long or short header | `*`, its CRC-32 in 8 hexadecimal digits, end of line |
//! | AA 44 12 | NovAtel binary, long header (28 bytes, or the length that it states) | its CRC-32, 4 bytes |
//! | AA 44 13 | NovAtel binary, short header (12 bytes) | its CRC-32, 4 bytes |
//! | `$` or `!` | NMEA 0183 | `*`, its checksum in 2 hexadecimal digits, end of line |
//! | `<`, a name in capitals, a blank | NovAtel abbreviated ASCII ([`abbreviated`]) | end of line; it has no checksum |
//!
//! NovAtel's CRC-32 has the reflected polynomial 0xEDB88320, the initial value 0 and no final complement, over the text between `#` and `*`, or over
//! header and body. NMEA's checksum is the exclusive or of the bytes between `$` and `*`. Other bytes are skipped up to the next possible start of a
//! message. After a line with a wrong CRC, the last possible start within it is tried, so that a line without an end does not damage the next one. After
//! a binary message with a wrong CRC, the search continues after its first three bytes.
//!
//! Some old NMEA talkers omit the checksum. A sentence without one is read if it is a complete line, has all the fields of its kind ([`FIELDS`]), and no
//! earlier sentence had a checksum.

use std::io::{self, BufRead};
use std::ops::Range;

use super::abbreviated;
use crate::account::Wrong;

/// Largest length of a line, bytes. The longest records of NovAtel's manual have some kilobytes.
const LONGEST_LINE: usize = 1 << 15;
/// Largest length of a binary message, bytes: header, a body of 65535 bytes, CRC.
const LONGEST: usize = 255 + 65_535 + 4;

/// Message with a correct checksum, or without one where its kind has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Message<'a> {
    /// NovAtel ASCII: whether its header is long, and the text between `#` and `*`.
    Text { long: bool, text: &'a str },
    /// NovAtel abbreviated ASCII, rewritten as the text of ASCII; it has no CRC.
    Abbreviated { long: bool, text: &'a str },
    /// NovAtel binary: header and body.
    Binary {
        long: bool,
        header: &'a [u8],
        body: &'a [u8],
    },
    /// NMEA: the text between `$` and `*`, and whether it had a checksum.
    Nmea { text: &'a str, checked: bool },
}

/// Result of a step of the framing.
pub(crate) enum Event<'a> {
    /// Valid message.
    Message(Message<'a>),
    /// Fault with its description.
    Wrong(Wrong, String),
}

/// Position in a stream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    /// Offset from the start of the stream, bytes.
    pub(crate) byte: u64,
    /// Line number, from 1; `None` after the first binary message.
    pub(crate) line: Option<u64>,
}

/// Splits a stream into messages.
pub(crate) struct Frames<R> {
    stream: R,
    /// Bytes read from the stream; the first `from` are processed.
    buffer: Vec<u8>,
    from: usize,
    ended: bool,
    at: At,
    /// Abbreviated ASCII record, rewritten as ASCII.
    rewritten: String,
    /// Whether an NMEA sentence had a checksum.
    checked: bool,
    /// Number of bytes outside valid messages, white space excluded.
    pub(crate) lost_bytes: u64,
}

/// NovAtel's CRC-32.
pub(crate) fn crc(bytes: &[u8]) -> u32 {
    // The library's CRC-32 complements its state at the start and at the end: the initial value !0 and
    // the complement of the result undo both.
    let mut hasher = crc32fast::Hasher::new_with_initial(!0);
    hasher.update(bytes);
    !hasher.finalize()
}

/// Result at a possible start of a message.
struct Found {
    /// Number of bytes that are processed.
    length: usize,
    /// `None` if no message starts here.
    content: Option<Content>,
}

enum Content {
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

    /// Number of processed bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.at.byte
    }

    /// Read until the buffer has `length` unprocessed bytes or the stream ends.
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

    /// Mark `length` bytes as processed, and count them as lost if `lost`.
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

    /// Next message or fault with its position; `None` at the end.
    pub(crate) fn next(&mut self) -> io::Result<Option<(At, Event<'_>)>> {
        let Some((at, start, content)) = self.find()? else {
            return Ok(None);
        };
        let seen = &self.buffer[start..];
        let text = |range: Range<usize>| std::str::from_utf8(&seen[range]).unwrap_or_default();
        let message = match content {
            Content::Wrong(wrong, text) => return Ok(Some((at, Event::Wrong(wrong, text)))),
            Content::Text { long, text: range } => Message::Text {
                long,
                text: text(range),
            },
            Content::Binary { long, header, end } => Message::Binary {
                long,
                header: &seen[..header],
                body: &seen[header..end],
            },
            Content::Abbreviated { long, text } => {
                self.rewritten = text;
                Message::Abbreviated {
                    long,
                    text: &self.rewritten,
                }
            }
            Content::Nmea {
                text: range,
                checked,
            } => Message::Nmea {
                text: text(range),
                checked,
            },
        };
        Ok(Some((at, Event::Message(message))))
    }

    /// Next message or fault, marked as processed, with its position in the stream and its start in the buffer.
    fn find(&mut self) -> io::Result<Option<(At, usize, Content)>> {
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
            let Some(content) = found.content else {
                self.pass(found.length, true);
                continue;
            };
            self.pass(found.length, matches!(content, Content::Wrong(..)));
            self.checked |= matches!(content, Content::Nmea { checked: true, .. });
            if let Content::Binary { .. } = content {
                // Lines have no number after binary data.
                self.at.line = None;
            }
            return Ok(Some((at, start, content)));
        }
    }
}

fn no_message(length: usize) -> Found {
    Found {
        length,
        content: None,
    }
}

fn wrong(length: usize, wrong: Wrong, description: String) -> Found {
    Found {
        length,
        content: Some(Content::Wrong(wrong, description)),
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
            let description = "binary message is cut short within its header".to_owned();
            return wrong(rest.len(), Wrong::Cut, description);
        }
        _ => return no_message(1),
    };
    let end = header + body;
    let Some(&given) = rest.get(end..).and_then(<[u8]>::first_chunk) else {
        let description = format!(
            "binary message is cut short: expected {} bytes, found {}",
            end + 4,
            rest.len()
        );
        return wrong(3, Wrong::Cut, description);
    };
    let (given, computed) = (u32::from_le_bytes(given), crc(&rest[..end]));
    if given != computed {
        let id = u16::from_le_bytes([rest[4], rest[5]]);
        let description = format!(
            "binary message {id} of {} bytes is damaged: its CRC is {given:08x}, expected {computed:08x} from its bytes",
            end + 4
        );
        return wrong(3, Wrong::Checksum, description);
    }
    Found {
        length: end + 4,
        content: Some(Content::Binary { long, header, end }),
    }
}

fn abbreviated(rest: &[u8]) -> Found {
    match abbreviated::record(rest) {
        Some((length, long, text)) => Found {
            length,
            content: Some(Content::Abbreviated { long, text }),
        },
        None => no_message(1),
    }
}

/// Length of a line's text, printable ASCII, bytes.
fn line_length(rest: &[u8]) -> usize {
    let most = rest.len().min(LONGEST_LINE);
    let printable = |b: &u8| matches!(b, b' '..=b'~' | b'\t');
    let end = rest[..most].iter().position(|b| !printable(b));
    end.unwrap_or(most)
}

/// Whether the text starts with a name: capitals, digits and underscores up to a comma or semicolon.
fn has_name(text: &[u8]) -> bool {
    let name = |b: &u8| b.is_ascii_uppercase() || b.is_ascii_digit() || *b == b'_';
    let length = text.iter().take_while(|b| name(b)).count();
    (3..=32).contains(&length)
        && text[0].is_ascii_uppercase()
        && matches!(text.get(length), None | Some(b',' | b';'))
}

/// Checksum of `digits` hexadecimal digits, which must be all the text after the `*`.
fn checksum(text: &[u8], digits: usize) -> Option<u32> {
    let text = text.trim_ascii_end();
    let hexadecimal = text.len() == digits && text.iter().all(u8::is_ascii_hexdigit);
    let text = std::str::from_utf8(text).ok()?;
    hexadecimal.then(|| u32::from_str_radix(text, 16).ok())?
}

/// Name of a line's message for descriptions of faults, or its first 20 characters.
fn shown(line: &[u8]) -> String {
    let end = line.iter().position(|&b| b == b',' || b == b';');
    let short = &line[..end.unwrap_or(line.len()).min(20)];
    String::from_utf8_lossy(short).into_owned()
}

/// Whether a message may start at byte `n` of a line.
fn begins(line: &[u8], n: usize) -> bool {
    matches!(line[n], b'#' | b'%' | b'$' | b'!') && has_name(&line[n + 1..])
}

/// Message or fault at the start of a line.
fn line(rest: &[u8], checked: bool) -> Found {
    let length = line_length(rest);
    let line = &rest[..length];
    if !begins(line, 0) {
        return no_message(1);
    }
    let ends = matches!(rest.get(length), Some(b'\r' | b'\n'));
    let at = |n| message_at(line, n, ends, checked);
    let content = at(0);
    // Another message may start within a line without an end: it is read next.
    let inner = match content {
        Content::Wrong(..) => (1..length).rev().find(|&n| begins(line, n)),
        _ => None,
    };
    match inner.filter(|&n| !matches!(at(n), Content::Wrong(..))) {
        Some(whole) => {
            let description = format!(
                "{} is cut short: another message starts within it",
                shown(&line[1..])
            );
            wrong(whole, Wrong::Cut, description)
        }
        None => Found {
            length,
            content: Some(content),
        },
    }
}

fn message_at(line: &[u8], n: usize, ends: bool, checked: bool) -> Content {
    match line[n] {
        b'#' | b'%' => novatel_at(line, n),
        _ => nmea_at(line, n, ends, checked),
    }
}

/// NovAtel message or fault from byte `n` of a line to its end.
fn novatel_at(line: &[u8], n: usize) -> Content {
    let name = shown(&line[n + 1..]);
    let star = line[n..].iter().rposition(|&b| b == b'*');
    let given = star.and_then(|star| Some((n + star, checksum(&line[n + star + 1..], 8)?)));
    let Some((star, given)) = given else {
        let description =
            format!("{name} is cut short: expected * and 8 hexadecimal digits at its end");
        return Content::Wrong(Wrong::Cut, description);
    };
    let computed = crc(&line[n + 1..star]);
    if given != computed {
        let description = format!(
            "{name} is damaged: its CRC is {given:08x}, expected {computed:08x} from its text"
        );
        return Content::Wrong(Wrong::Checksum, description);
    }
    Content::Text {
        long: line[n] == b'#',
        text: n + 1..star,
    }
}

/// Least number of fields after the name, by sentence.
const FIELDS: [(&str, usize); 6] = [
    ("GGA", 14),
    ("RMC", 11),
    ("ZDA", 6),
    ("GST", 8),
    ("VTG", 8),
    ("HDT", 2),
];

/// Sentence without a checksum, or its fault. `ends`: the line has a line end. `checked`: earlier sentences have checksums.
fn unchecked_at(line: &[u8], n: usize, name: &str, ends: bool, checked: bool) -> Content {
    let text = &line[n + 1..];
    let fields = text.iter().filter(|&&b| b == b',').count();
    let least = FIELDS
        .iter()
        .find(|(kind, _)| name.len() == 5 && name.ends_with(kind))
        .map_or(1, |&(_, fields)| fields);
    // A truncated or damaged checksum leaves its asterisk.
    let starred = text.contains(&b'*');
    let whole = fields >= least && ends && !starred;
    match whole {
        true if !checked => Content::Nmea {
            text: n + 1..line.len(),
            checked: false,
        },
        true => Content::Wrong(
            Wrong::Cut,
            format!("{name} has no checksum, expected one as in earlier sentences"),
        ),
        false => Content::Wrong(
            Wrong::Cut,
            match fields < least {
                true => format!(
                    "{name} is cut short: expected * and 2 hexadecimal digits at its end, and found {fields} of {least} fields"
                ),
                false => {
                    format!("{name} is cut short: expected * and 2 hexadecimal digits at its end")
                }
            },
        ),
    }
}

/// NMEA sentence or fault from byte `n` of a line to its end.
fn nmea_at(line: &[u8], n: usize, ends: bool, checked: bool) -> Content {
    let name = shown(&line[n + 1..]);
    let star = line[n..].iter().rposition(|&b| b == b'*');
    let given = star.and_then(|star| Some((n + star, checksum(&line[n + star + 1..], 2)?)));
    let Some((star, given)) = given else {
        return unchecked_at(line, n, &name, ends, checked);
    };
    let computed = line[n + 1..star].iter().fold(0, |sum, byte| sum ^ byte);
    if given != u32::from(computed) {
        let description = format!(
            "{name} is damaged: its checksum is {given:02X}, expected {computed:02X} from its text"
        );
        return Content::Wrong(Wrong::Checksum, description);
    }
    Content::Nmea {
        text: n + 1..star,
        checked: true,
    }
}
