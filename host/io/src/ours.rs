//! Detection of files that this program wrote, by their contents and never by their names.
//!
//! | kind | how it shows |
//! |---|---|
//! | CPHD | the XML's `ProductInfo` has a parameter `Program` that is [`PROGRAM`] |
//! | SICD | the originator in the NITF header is [`NITF_MARK`] |
//! | maps | the format is this program's own |
//! | STAC item | its `schema` is [`ITEM_SCHEMA`] |
//! | map (GeoTIFF, KMZ) | it is TIFF or an archive whose first 64 KiB hold `written by subap` |
//! | picture (PNG) | its text chunk `Software` is [`PROGRAM`] |
//! | JSON | its `schema` begins with `subaperture-`; if it is cut short, its first key is that |
//! | text (HTML, Markdown) | its first line holds `written by subap` |
//! | description (TOML) | so does its first line, with the CRC-32 of all that follows: one that was edited is its editor's |
//! | array (NumPy) | a record beside it, JSON or TOML of this program, states its size and CRC-32 |
//!
//! An empty file may always be replaced.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek};
use std::path::Path;

use serde::Deserialize;

use super::input::{checksum, open_file};
use super::json::{self, Limits};
use subaperture_model::PROGRAM;

/// What the first line of a text holds.
pub const TEXT_MARK: &str = "written by subap";

/// Who is named as the originator (`ONAME`) of NITF files.
pub const NITF_MARK: &str = "Subaperture";

/// What begins the `schema` of JSON.
const SCHEMA: &str = "subaperture-";

/// The `schema` of STAC items.
pub const ITEM_SCHEMA: &str = "subaperture-stac-item";

/// How far a CPHD is searched for its mark: a header and the longest XML that is read.
const MAX_HEADER_BYTES: u64 = 9 << 20;

/// Bounds on JSON that is looked into: only a few keys of it are kept.
const JSON_LIMITS: Limits = Limits {
    bytes: 256 << 20,
    string_bytes: 4 << 20,
    value_bytes: 0,
};

/// Longest description that is looked into.
const MAX_DESCRIPTION_BYTES: u64 = 16 << 20;

/// Kinds of files that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Phase history as CPHD.
    Collection,
    /// A complex image as SICD, in NITF.
    Sicd,
    /// A module's maps.
    Maps,
    /// A map, GeoTIFF or KMZ.
    Map,
    /// STAC item that describes a map.
    Item,
    /// A picture, PNG.
    Picture,
    /// A record, JSON.
    Record,
    /// HTML or Markdown.
    Text,
    /// A recording's description, TOML.
    Description,
    /// A NumPy array that a record beside it speaks of.
    Array,
}

impl Kind {
    /// That of a file in a folder of ours, by its name's ending.
    pub fn of_name(name: &str) -> Self {
        match name.rsplit_once('.') {
            Some((_, "png")) => Self::Picture,
            Some((_, "json")) => Self::Record,
            Some((_, "npy")) => Self::Array,
            Some((_, "nitf")) => Self::Sicd,
            Some((_, "toml")) => Self::Description,
            _ => Self::Text,
        }
    }
}

/// Whether the file at `path` is one of this kind that this program wrote, or empty; if not, what it is.
pub(super) fn objection(path: &Path, kind: Kind) -> io::Result<Option<&'static str>> {
    let mut file = open_file(path)?;
    if file.metadata()?.len() == 0 {
        return Ok(None);
    }
    let ours = match kind {
        Kind::Collection => starts_with(&mut file, b"CPHD/1.")? && has_mark(&mut file)?,
        Kind::Sicd => is_our_nitf(&mut file)?,
        Kind::Maps => starts_with(&mut file, b"SUBAPMAP")?,
        Kind::Map => is_our_map(file)?,
        Kind::Item => schema(&file).is_some_and(|schema| schema == ITEM_SCHEMA),
        Kind::Picture => is_our_picture(&mut file)?,
        Kind::Record => {
            schema(&file).is_some_and(|s| s.starts_with(SCHEMA)) || begins_as_record(&mut file)?
        }
        Kind::Text => {
            let mut start = Vec::new();
            file.take(400).read_to_end(&mut start)?;
            let first = start.split(|&b| b == b'\n').next().unwrap_or_default();
            contains(first, TEXT_MARK.as_bytes())
        }
        Kind::Description => {
            let mut text = Vec::new();
            file.take(MAX_DESCRIPTION_BYTES).read_to_end(&mut text)?;
            is_our_description(&text)
        }
        Kind::Array => is_recorded(path, file)?,
    };
    Ok((!ours).then_some(match kind {
        Kind::Collection => "it is no CPHD that subap wrote",
        Kind::Sicd => "it is no SICD that subap wrote",
        Kind::Maps => "it is no file of maps",
        Kind::Map => "it is no map that subap wrote",
        Kind::Item => "it is no STAC item that subap wrote",
        Kind::Picture => "it is no picture that subap drew",
        Kind::Record => "it is no record that subap wrote",
        Kind::Text => "it is no text that subap wrote",
        Kind::Description => "it is no description that subap wrote, or it was edited since",
        Kind::Array => "no record of subap beside it is of this array",
    }))
}

fn starts_with(file: &mut File, magic: &[u8]) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(magic.len() as u64).read_to_end(&mut start)?;
    Ok(start == magic)
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// The element by which [`super::cphd::write()`] marks a file.
pub(super) fn cphd_mark() -> String {
    format!("<Parameter name=\"Program\">{PROGRAM}</Parameter>")
}

fn has_mark(file: &mut File) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(MAX_HEADER_BYTES).read_to_end(&mut start)?;
    Ok(contains(&start, cphd_mark().as_bytes()))
}

/// The originator is within the first 400 bytes.
fn is_our_nitf(file: &mut File) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(400).read_to_end(&mut start)?;
    Ok(start.starts_with(b"NITF02.10") && contains(&start, NITF_MARK.as_bytes()))
}

/// The mark is in the first directory, or in the first document.
fn is_our_map(file: File) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(1 << 16).read_to_end(&mut start)?;
    let kinds: [&[u8]; 3] = [b"II*\0", b"II+\0", b"PK\x03\x04"];
    Ok(kinds.iter().any(|kind| start.starts_with(kind)) && contains(&start, TEXT_MARK.as_bytes()))
}

/// The chunk comes before the pixels.
fn is_our_picture(file: &mut File) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(400).read_to_end(&mut start)?;
    let chunk = format!("tEXtSoftware\0{PROGRAM}");
    Ok(start.starts_with(b"\x89PNG") && contains(&start, chunk.as_bytes()))
}

/// The schema that JSON states, if it is whole.
fn schema(file: &File) -> Option<String> {
    #[derive(Deserialize)]
    struct Record {
        schema: String,
    }
    let record: Record = json::typed(file, JSON_LIMITS).ok()?;
    Some(record.schema)
}

/// What a record states of a file; of tiles it states other things.
#[derive(Deserialize)]
struct About {
    bytes: Option<u64>,
    crc32: Option<String>,
}

/// What a record of ours states of the file `name`.
fn stated(record: &File, name: &str) -> Option<About> {
    #[derive(Deserialize)]
    struct Record {
        schema: String,
        files: BTreeMap<String, About>,
    }
    let mut record: Record = json::typed(record, JSON_LIMITS).ok()?;
    let ours = record.schema.starts_with(SCHEMA);
    record.files.remove(name).filter(|_| ours)
}

/// Whether the first key is a schema of ours: of a record that was cut short.
fn begins_as_record(file: &mut File) -> io::Result<bool> {
    file.rewind()?;
    let mut start = Vec::new();
    file.take(100).read_to_end(&mut start)?;
    let start: String = String::from_utf8_lossy(&start).split_whitespace().collect();
    Ok(start.starts_with(&format!("{{\"schema\":\"{SCHEMA}")))
}

/// A description with its first line.
#[cfg(feature = "recording")]
pub(super) fn marked_description(text: &str) -> String {
    format!("{}\n{text}", description_mark(text.as_bytes()))
}

fn description_mark(text: &[u8]) -> String {
    let crc32 = crc32fast::hash(text);
    format!("# {TEXT_MARK}; all below this line has CRC-32 {crc32:08x}")
}

fn is_our_description(whole: &[u8]) -> bool {
    let Some(end) = whole.iter().position(|&b| b == b'\n') else {
        return false;
    };
    whole[..end] == *description_mark(&whole[end + 1..]).as_bytes()
}

/// The line of a description that speaks of an array.
pub(super) fn array_line(name: &str, bytes: u64, crc32: &str) -> String {
    format!("# {name}: {bytes} bytes, CRC-32 {crc32}")
}

/// Whether a record in the same folder states the size and CRC-32 that the array has.
fn is_recorded(path: &Path, mut array: File) -> io::Result<bool> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name().and_then(|n| n.to_str()))
    else {
        return Ok(false);
    };
    let bytes = array.metadata()?.len();
    let mut sum: Option<String> = None;
    for entry in fs::read_dir(folder)?.flatten() {
        let record_name = entry.file_name();
        let record_name = record_name.to_string_lossy();
        let states: &dyn Fn(&str) -> bool = if record_name.ends_with(".json") {
            let about = match open_file(&entry.path()) {
                Ok(file) => stated(&file, name),
                Err(_) => None,
            };
            &move |crc32: &str| {
                about.as_ref().is_some_and(|about| {
                    about.bytes == Some(bytes) && about.crc32.as_deref() == Some(crc32)
                })
            }
        } else if record_name.ends_with(".toml") {
            let mut text = Vec::new();
            if let Ok(file) = open_file(&entry.path()) {
                file.take(1 << 16).read_to_end(&mut text)?;
            }
            let ours = contains(&text, TEXT_MARK.as_bytes());
            &move |crc32: &str| ours && contains(&text, array_line(name, bytes, crc32).as_bytes())
        } else {
            continue;
        };
        let crc32 = match &sum {
            Some(sum) => sum.clone(),
            None => checksum(&mut array)?.1,
        };
        if states(&crc32) {
            return Ok(true);
        }
        sum = Some(crc32);
    }
    Ok(false)
}
