//! Findings kept in files, and found again by a later run.

use std::fs;
use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Context, Finding, Item};
use subaperture_io::atomic::{WriteError, write_atomically};

const SCHEMA: &str = "subaperture-finding";

/// What the file of a finding holds.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// By which a later run knows that it may replace the file.
    schema: String,
    /// What it was made from.
    key: String,
    source: String,
    title: String,
    agrees: bool,
    finding: Finding,
    /// CRC-32 of each picture's file.
    pictures_crc32: Vec<String>,
}

/// What an item's finding depends on beside the code of one version: the recordings it may use.
pub(super) fn key(item: &Item, context: &Context) -> String {
    let mut key = format!("{} {}", env!("CARGO_PKG_VERSION"), item.id);
    for path in context.gotcha {
        let bytes = fs::metadata(path).map_or(0, |about| about.len());
        key.push_str(&format!(" {} {bytes}", path.display()));
    }
    key
}

fn crc32(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

/// Files of this folder that items of ours would replace, and the page.
pub(super) fn names(folder: &Path, items: &[Item]) -> Vec<String> {
    let mut names: Vec<String> = items
        .iter()
        .map(|item| format!("{}.json", item.id))
        .collect();
    names.push("index.html".to_owned());
    // Pictures have names of their own, which only the finding knows.
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

fn picture_file(item: &Item, name: &str) -> String {
    format!("{}-{name}.png", item.id)
}

/// A whole finding of the same key, if one is there.
pub(super) fn load(folder: &Path, item: &Item, key: &str) -> Option<Finding> {
    let text = fs::read(folder.join(format!("{}.json", item.id))).ok()?;
    let Kept {
        key: kept_key,
        mut finding,
        pictures_crc32,
        ..
    } = serde_json::from_slice(&text).ok()?;
    if kept_key != key || pictures_crc32.len() != finding.pictures.len() {
        return None;
    }
    for (picture, crc) in finding.pictures.iter_mut().zip(pictures_crc32) {
        picture.png = fs::read(folder.join(picture_file(item, &picture.name))).ok()?;
        if crc32(&picture.png) != crc {
            return None;
        }
    }
    Some(finding)
}

/// Keeps a finding: pictures first, so that whoever finds the text finds them too.
pub(super) fn save(
    folder: &Path,
    item: &Item,
    key: &str,
    finding: &Finding,
) -> Result<(), WriteError> {
    for picture in &finding.pictures {
        let path = folder.join(picture_file(item, &picture.name));
        write_atomically(&path, picture.png.len() as u64, |file| {
            file.write_all(&picture.png)
        })?;
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
    let path = folder.join(format!("{}.json", item.id));
    write_atomically(&path, 0, |file| {
        serde_json::to_writer_pretty(&mut *file, &kept)?;
        file.write_all(b"\n")
    })
}
