//! Storage of findings, and their reuse by a later run.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Context, Finding, Item};
use subaperture_io::atomic::WriteError;
use subaperture_io::input::open_file;
use subaperture_io::json::{self, Limits};
use subaperture_io::together::FileSet;
use subaperture_io::written::{FileKind, WrittenFile};

/// Size limits of a stored finding.
const LIMITS: Limits = Limits {
    bytes: 16 << 20,
    string_bytes: 1 << 20,
    value_bytes: 64 << 20,
};

const SCHEMA: &str = "subaperture-finding";

/// Content of a finding's file.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Mark of a file that a later run may replace.
    schema: String,
    /// Inputs of the finding.
    key: String,
    source: String,
    title: String,
    agrees: bool,
    finding: Finding,
    /// CRC-32 of each picture's file.
    pictures_crc32: Vec<String>,
}

/// Inputs of an item apart from the program version: its scale, and the recordings it may use.
pub(super) fn key(item: &Item, context: &Context) -> String {
    let mut key = format!("{} {}", env!("CARGO_PKG_VERSION"), item.id);
    if context.full && item.full_work().is_some() {
        key.push_str(" full");
    }
    for path in context.gotcha {
        let bytes = fs::metadata(path).map_or(0, |about| about.len());
        key.push_str(&format!(" {} {bytes}", path.display()));
    }
    key
}

fn crc32(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

/// Files of this folder that a run may replace: those of items, and the page.
pub(super) fn names(folder: &Path, items: &[Item]) -> Vec<String> {
    let mut names: Vec<String> = items
        .iter()
        .map(|item| format!("{}.json", item.id))
        .collect();
    names.push("index.html".to_owned());
    // Names of pictures are known from the finding only.
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let is_picture = |item: &Item| {
            let rest = name
                .strip_prefix(item.id)
                .and_then(|rest| rest.strip_prefix('-'));
            rest.is_some_and(|rest| rest.ends_with(".png"))
        };
        if items.iter().any(is_picture) {
            names.push(name.to_owned());
        }
    }
    names
}

fn picture_path(folder: &Path, item: &Item, name: &str) -> PathBuf {
    folder.join(format!("{}-{name}.png", item.id))
}

fn record_path(folder: &Path, item: &Item) -> PathBuf {
    folder.join(format!("{}.json", item.id))
}

/// Load a complete finding with this key and its files, if present.
pub(super) fn load(folder: &Path, item: &Item, key: &str) -> Option<(Finding, Vec<WrittenFile>)> {
    let record = record_path(folder, item);
    let file = open_file(&record).ok()?;
    let Kept {
        key: kept_key,
        mut finding,
        pictures_crc32,
        ..
    } = serde_json::from_value(json::value(file, LIMITS).ok()?).ok()?;
    if kept_key != key || pictures_crc32.len() != finding.pictures.len() {
        return None;
    }
    let mut files = Vec::new();
    for (picture, crc) in finding.pictures.iter_mut().zip(pictures_crc32) {
        let path = picture_path(folder, item, &picture.name);
        picture.png = fs::read(&path).ok()?;
        if crc32(&picture.png) != crc {
            return None;
        }
        files.push(WrittenFile::new(path, FileKind::Picture));
    }
    files.push(WrittenFile::new(record, FileKind::Record));
    Some((finding, files))
}

/// Keep a finding with its pictures, all or none. Returns the files.
pub(super) fn save(
    folder: &Path,
    item: &Item,
    key: &str,
    finding: &Finding,
) -> Result<Vec<WrittenFile>, WriteError> {
    let mut files = FileSet::new();
    for picture in &finding.pictures {
        let path = picture_path(folder, item, &picture.name);
        files.write_bytes(&path, FileKind::Picture, &picture.png)?;
    }
    let kept = Kept {
        schema: SCHEMA.to_owned(),
        key: key.to_owned(),
        source: item.source.to_owned(),
        title: item.title.to_owned(),
        agrees: finding.agrees(),
        finding: finding.clone(),
        pictures_crc32: finding.pictures.iter().map(|p| crc32(&p.png)).collect(),
    };
    files.write(&record_path(folder, item), FileKind::Record, 0, |file| {
        let mut text = serde_json::to_vec_pretty(&kept)?;
        text.push(b'\n');
        file.write_all(&text)
    })?;
    files.commit()
}
