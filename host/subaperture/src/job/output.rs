//! Output files of a stage.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use subaperture_io::written::{FileKind, WrittenFile};

use super::stamp::{FileStamp, stamp};
use crate::recognise;

/// Output file of a stage, with size and CRC-32.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageOutput {
    /// Content, with the path relative to the job's folder.
    #[serde(flatten)]
    pub stamp: FileStamp,
    /// Kind; `None` in states of version 0.1.0, see [`Self::file`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<FileKind>,
}

impl StageOutput {
    /// Output of a file in the folder of a job; `None` if the file does not exist.
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn of(file: &WrittenFile, folder: &Path) -> io::Result<Option<Self>> {
        let within = file.path.strip_prefix(folder).unwrap_or(&file.path);
        let parts: Vec<_> = within.iter().map(|part| part.to_string_lossy()).collect();
        let stamp = stamp(&file.path, &parts.join("/"))?;
        Ok(stamp.map(|stamp| Self {
            stamp,
            kind: Some(file.kind),
        }))
    }

    /// The file in the job's folder, with its recorded kind or the one that its name implies.
    pub fn file(&self, folder: &Path) -> WrittenFile {
        let path = folder.join(&self.stamp.path);
        let kind = self.kind.unwrap_or_else(|| implied_kind(&path));
        WrittenFile::new(path, kind)
    }

    /// Whether the file in the job's folder is still that of the stage.
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn is_unchanged(&self, folder: &Path) -> io::Result<bool> {
        let path = &self.stamp.path;
        Ok(stamp(&folder.join(path), path)?.as_ref() == Some(&self.stamp))
    }
}

/// Kind of an output by its name; a correction is identified by its content.
fn implied_kind(path: &Path) -> FileKind {
    let name = path.file_name().unwrap_or_default();
    match &*name.to_string_lossy() {
        "image.zarr" => FileKind::Image,
        "track.csv" => FileKind::Track,
        "correction.csv" => match recognise::recognise(path) {
            recognise::FileKind::Phases => FileKind::PhaseCorrection,
            _ => FileKind::Track,
        },
        "sicd.nitf" => FileKind::Sicd,
        "sidd.nitf" => FileKind::Sidd,
        "map.tif" => FileKind::Cog,
        "map.kmz" => FileKind::Kmz,
        "map.png" => FileKind::Png,
        "map.json" | "map.pgw" | "map.prj" => FileKind::Sidecar,
        "stack.zarr" => FileKind::Zarr,
        name if name.ends_with(".png") => FileKind::Picture,
        _ => FileKind::Record,
    }
}
