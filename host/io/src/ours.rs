//! Recognition of files written by this program, by content and not by name.
//!
//! | kind | mark |
//! |---|---|
//! | CPHD | the XML's `ProductInfo` has a parameter `Program` that is [`PROGRAM`] |
//! | SICD | the originator in the NITF header is [`NITF_MARK`] |
//! | maps | the format is specific to this program |
//! | STAC item | its `schema` is [`ITEM_SCHEMA`] |
//! | map (GeoTIFF, KMZ) | TIFF or archive with `written by subap` in its first 64 KiB |
//! | picture (PNG) | its text chunk `Software` is [`PROGRAM`] |
//! | JSON | its `schema` begins with `subaperture-`; in a truncated file the first key counts |
//! | text (HTML, Markdown) | the first line contains `written by subap` |
//! | description (TOML) | the first line contains `written by subap` and the CRC-32 of the rest, so that an edited file belongs to its editor |
//! | navigation log | the first line contains `written by subap`, or SBET without acceleration and rates |
//! | array (NumPy) | a JSON or TOML record of this program in the same folder states its size and CRC-32 |
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

/// Mark in the first line of a text.
pub const TEXT_MARK: &str = "written by subap";

/// Originator (`ONAME`) of NITF files.
pub const NITF_MARK: &str = "Subaperture";

/// Prefix of `schema` in JSON.
const SCHEMA: &str = "subaperture-";

/// Value of `schema` in STAC items.
pub const ITEM_SCHEMA: &str = "subaperture-stac-item";

/// Number of bytes of a CPHD file searched for the mark: a header and the longest XML that is read.
const MAX_HEADER_BYTES: u64 = 9 << 20;

/// Limits on JSON that is examined; only a few keys are kept.
const JSON_LIMITS: Limits = Limits {
    bytes: 256 << 20,
    string_bytes: 4 << 20,
    value_bytes: 0,
};

/// Maximum length of a description that is examined.
const MAX_DESCRIPTION_BYTES: u64 = 16 << 20;

/// Kinds of output files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Phase history, CPHD.
    Collection,
    /// Complex image, SICD in NITF.
    Sicd,
    /// Maps of an embedded module.
    Maps,
    /// Map, GeoTIFF or KMZ.
    Map,
    /// STAC item that describes a map.
    Item,
    /// Picture, PNG.
    Picture,
    /// Record, JSON.
    Record,
    /// HTML or Markdown.
    Text,
    /// Description of a recording, TOML.
    Description,
    /// NumPy array stated by a record in the same folder.
    Array,
    /// Moving targets, STANAG 4607 packet.
    Gmtif,
    /// Simulated navigation log: text, or SBET without acceleration and rates.
    NavigationLog,
}

impl Kind {
    /// Kind of a file in an output folder, by the suffix of its name.
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

/// Reason why the file at `path` may not be replaced as one of this kind. `None` if this program wrote it, or if it
/// is empty.
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
        Kind::NavigationLog if is_our_sbet(&file)? => true,
        Kind::Text | Kind::NavigationLog => {
            file.rewind()?;
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
        // A packet has no room for a mark: only its own format is recognised.
        Kind::Gmtif => starts_with(&mut file, b"30\0")?,
    };
    Ok((!ours).then_some(match kind {
        Kind::Collection => "it is not a CPHD file written by subap",
        Kind::Sicd => "it is not a SICD file written by subap",
        Kind::Maps => "it is not a maps file",
        Kind::Map => "it is not a map written by subap",
        Kind::Item => "it is not a STAC item written by subap",
        Kind::Picture => "it is not a picture written by subap",
        Kind::Record => "it is not a record written by subap",
        Kind::Text => "it is not a text written by subap",
        Kind::Description => "it is not a description written by subap, or was edited afterwards",
        Kind::NavigationLog => "it is not a navigation log written by subap",
        Kind::Gmtif => "it is not a STANAG 4607 packet of version 30",
        Kind::Array => "it is not an array stated by a record of subap in the same folder",
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

/// Whether this is an SBET whose first record has acceleration and rates of exactly 0, which no instrument measures.
fn is_our_sbet(file: &File) -> io::Result<bool> {
    let whole = file.metadata()?.len() % 136 == 0;
    let mut record = Vec::new();
    file.take(136).read_to_end(&mut record)?;
    let zero = |bytes: &[u8]| bytes.iter().all(|&byte| byte == 0);
    Ok(whole && record.len() == 136 && !zero(&record[..88]) && zero(&record[88..]))
}

/// Element that marks the files of [`super::cphd::write()`].
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

/// Schema of a complete JSON file.
fn schema(file: &File) -> Option<String> {
    #[derive(Deserialize)]
    struct Record {
        schema: String,
    }
    let record: Record = json::typed(file, JSON_LIMITS).ok()?;
    Some(record.schema)
}

/// Size and checksum of a file as stated by its record; records of tiles state other values.
#[derive(Deserialize)]
struct About {
    bytes: Option<u64>,
    crc32: Option<String>,
}

/// Statement of a record of this program about the file `name`.
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

/// Whether the first key is a schema of this program, as in a truncated record.
fn begins_as_record(file: &mut File) -> io::Result<bool> {
    file.rewind()?;
    let mut start = Vec::new();
    file.take(100).read_to_end(&mut start)?;
    let start: String = String::from_utf8_lossy(&start).split_whitespace().collect();
    Ok(start.starts_with(&format!("{{\"schema\":\"{SCHEMA}")))
}

/// Description with its first line added.
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

/// Line of a description that states size and CRC-32 of an array.
pub(super) fn array_line(name: &str, bytes: u64, crc32: &str) -> String {
    format!("# {name}: {bytes} bytes, CRC-32 {crc32}")
}

/// Whether a record in the same folder states the size and CRC-32 of the array.
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
