//! Memory of a parsed text, estimated before its tree is made.
//!
//! An inline table of one key, `{a=1}`, is five bytes of text and more than two kilobytes of memory, since a node of a tree has room for
//! eleven entries. The estimate counts the events of the parser itself, so that no text means less to the estimate than to the parser.
//!
//! **Memory** of the estimate: a list of the text's tokens, made only where 80 bytes for each are within the limit.
//!
//! **Accuracy**: at least the memory measured, and at most 4 times as much, for texts of many tables, dotted keys, headers, keys,
//! numbers, arrays and points of a scene (`tests/cli/parsed_memory.rs`).

use toml_parser::Source;
use toml_parser::parser::{Event, EventKind, RecursionGuard, parse_document};

use super::error::{ALLOW_MORE_MEMORY, Fault, Location};

/// Memory of a parsed text where no other limit is given, bytes.
pub const DEFAULT_MEMORY_BYTES: u64 = 1 << 30;

/// A token in a list that grows by doubling, and its event.
const TOKEN_BYTES: u64 = 80;
/// A table: a node of 11 entries in the tree of a description, the unfreed part of one in the parser's tree, and its place in an array.
const TABLE_BYTES: u64 = 1300;
/// A key: its share of a node at the least filled, and its texts.
const KEY_BYTES: u64 = 280;
/// A value of an array, in lists that grow by doubling.
const ELEMENT_BYTES: u64 = 120;
/// An array: room for four values.
const ARRAY_BYTES: u64 = 260;
/// Copies of a byte of text: the text, a string of each tree, and of its values.
const COPIES: u64 = 4;

/// Largest number of parts of a dotted key. Each part is a table within another.
const MAX_PARTS: u64 = 64;
/// Nesting at which the parser stops.
const MAX_DEPTH: u32 = 80;

/// Memory that `text` takes while it is parsed and resolved, bytes. Above `memory_bytes` the value need not be exact.
///
/// # Errors
/// The fault of a key with too many parts.
pub fn parsed_bytes(text: &str, memory_bytes: u64) -> Result<u64, Fault> {
    let source = Source::new(text);
    let num_tokens = source.lex().count();
    let needed_bytes = TOKEN_BYTES * num_tokens as u64 + COPIES * text.len() as u64;
    if needed_bytes > memory_bytes {
        return Ok(needed_bytes);
    }
    let mut tokens = Vec::with_capacity(num_tokens);
    tokens.extend(source.lex());
    let mut count = Count::new(text);
    let mut next = |event: Event| count.next(&event);
    let mut receiver = RecursionGuard::new(&mut next, MAX_DEPTH);
    parse_document(&tokens, &mut receiver, &mut ());
    match count.too_long {
        None => Ok(needed_bytes + count.bytes),
        Some(at) => Err(Fault::new(
            &at,
            format!("expected a key of at most {MAX_PARTS} parts between dots, found more"),
        )),
    }
}

/// Refuse a text that would take more than `memory_bytes`.
pub(crate) fn check(text: &str, memory_bytes: u64) -> Result<(), Fault> {
    let needed_bytes = parsed_bytes(text, memory_bytes)?;
    if needed_bytes <= memory_bytes {
        return Ok(());
    }
    Err(Fault::new(
        &Location::Text(0..0),
        format!(
            "expected TOML that takes at most {} of memory, found one that would need {} or more: divide it into smaller \
             files, or {ALLOW_MORE_MEMORY}",
            mebibytes(memory_bytes),
            mebibytes(needed_bytes)
        ),
    ))
}

pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Memory of the events so far.
struct Count<'t> {
    text: &'t str,
    bytes: u64,
    /// Parts of the key at hand.
    parts: u64,
    /// Start of the header's key at hand, and the end of all but its last part.
    header: Option<(usize, usize)>,
    /// All but the last part of the last header's key: its tables are made once.
    path: &'t str,
    too_long: Option<Location>,
}

impl<'t> Count<'t> {
    fn new(text: &'t str) -> Self {
        Self {
            text,
            bytes: 0,
            parts: 0,
            header: None,
            path: "",
            too_long: None,
        }
    }

    fn next(&mut self, event: &Event) {
        let span = event.span();
        match event.kind() {
            EventKind::StdTableOpen | EventKind::ArrayTableOpen => {
                self.bytes += TABLE_BYTES;
                self.header = Some((span.end(), span.end()));
                self.parts = 0;
            }
            EventKind::StdTableClose | EventKind::ArrayTableClose => self.end_header(),
            EventKind::InlineTableOpen => {
                self.bytes += TABLE_BYTES;
                self.parts = 0;
            }
            EventKind::ArrayOpen => self.bytes += ARRAY_BYTES,
            EventKind::SimpleKey => {
                self.bytes += KEY_BYTES;
                self.parts += 1;
                if self.parts > MAX_PARTS {
                    let at = Location::Text(span.start()..span.end());
                    self.too_long.get_or_insert(at);
                }
            }
            EventKind::KeySep => match &mut self.header {
                Some((_, end)) => *end = span.start(),
                None => self.bytes += TABLE_BYTES,
            },
            EventKind::KeyValSep => self.parts = 0,
            EventKind::Scalar => self.bytes += ELEMENT_BYTES,
            EventKind::Newline => {
                // Of a header that was never closed.
                self.end_header();
                self.parts = 0;
            }
            EventKind::InlineTableClose
            | EventKind::ArrayClose
            | EventKind::ValueSep
            | EventKind::Whitespace
            | EventKind::Comment
            | EventKind::Error => {}
        }
    }

    fn end_header(&mut self) {
        let Some((start, end)) = self.header.take() else {
            return;
        };
        let path = self.text.get(start..end).unwrap_or_default();
        if path != self.path {
            self.bytes += TABLE_BYTES * self.parts.saturating_sub(1);
            self.path = path;
        }
    }
}
