//! Description of a file, and memory-limited reading of texts.

use std::io::Read;
use std::path::Path;

use anyhow::{Context, bail};
use serde_json::Value;
use subaperture::io::input::open_file;
use subaperture::io::json::{self, Limits};

use crate::config::Session;

/// Most bytes of memory per byte of parsed JSON text.
const PARSED_BYTES: u64 = 32;

/// Description of a file as text and JSON.
pub(super) struct Description {
    pub(super) text: String,
    pub(super) json: Value,
}

pub(super) fn line(label: &str, value: &str) -> String {
    format!("{label:<16} {value}\n")
}

/// Read a text to be parsed in memory, if the budget allows.
pub(super) fn read_text(session: &Session, path: &Path) -> anyhow::Result<Vec<u8>> {
    let most_bytes = session.memory_bytes / PARSED_BYTES;
    let mut text = Vec::new();
    let read = open_file(path).and_then(|file| file.take(most_bytes + 1).read_to_end(&mut text));
    read.with_context(|| format!("cannot read {}", path.display()))?;
    if text.len() as u64 > most_bytes {
        bail!(
            "{}: expected at most {most_bytes} bytes of text (limited by --memory), found more: raise --memory",
            path.display()
        );
    }
    Ok(text)
}

/// Read a JSON record of this program.
pub(super) fn read_record(session: &Session, path: &Path) -> anyhow::Result<Value> {
    let limits = Limits {
        bytes: session.memory_bytes,
        string_bytes: session.memory_bytes / PARSED_BYTES,
        value_bytes: session.memory_bytes / 8,
    };
    let file = open_file(path).with_context(|| format!("cannot read {}", path.display()))?;
    json::value(file, limits).with_context(|| path.display().to_string())
}
