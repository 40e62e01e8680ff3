//! Sets of files that are written and synced under hidden names, then renamed together.
//!
//! A failed rename undoes the earlier ones: the previous files are restored, and new files are absent. Only a killed
//! process or a power cut between two renames leaves some files new and others old, each complete.
//!
//! ```
//! # use std::io::Write;
//! # use subaperture_io::together::FileSet;
//! # use subaperture_io::written::FileKind;
//! # let folder = tempfile::tempdir()?;
//! # let (map, item) = (folder.path().join("map.tif"), folder.path().join("map.json"));
//! let mut files = FileSet::new();
//! files.write(&map, FileKind::Cog, 3, |file| file.write_all(b"map"))?;
//! files.write(&item, FileKind::Sidecar, 2, |file| file.write_all(b"{}"))?;
//! assert!(!map.exists());
//! let written = files.commit()?;
//! assert!(map.exists() && item.exists());
//! assert_eq!((&written[0].path, written[1].kind), (&map, FileKind::Sidecar));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::fs::File;
use std::io;
use std::path::Path;

use super::atomic::{AtomicFile, WriteError};
use super::moves::{self, Moves};
use super::staging::{StagedSet, settled};
use super::written::{FileKind, WrittenFile};

/// Set of files not yet renamed. Removed when dropped without commit.
#[derive(Debug, Default)]
pub struct FileSet {
    parts: Vec<Part>,
    /// Files of all parts.
    files: Vec<WrittenFile>,
}

#[derive(Debug)]
enum Part {
    File(AtomicFile),
    Folder(StagedSet),
}

impl FileSet {
    /// Create an empty set.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether the set has no files.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Write a file like [`write_atomically`](super::atomic::write_atomically), but leave the rename to
    /// [`Self::commit`].
    ///
    /// # Errors
    /// [`WriteError`]. Files added before remain in the set.
    pub fn write<T>(
        &mut self,
        path: &Path,
        kind: FileKind,
        needed_bytes: u64,
        write: impl FnOnce(&mut File) -> io::Result<T>,
    ) -> Result<T, WriteError> {
        let mut file = AtomicFile::create(path, needed_bytes, ".part")?;
        let value = write(file.file()).map_err(|source| file.failed(source))?;
        self.add(file, WrittenFile::new(path, kind))?;
        Ok(value)
    }

    /// Write a file with these bytes.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_bytes(
        &mut self,
        path: &Path,
        kind: FileKind,
        bytes: &[u8],
    ) -> Result<(), WriteError> {
        self.write(path, kind, bytes.len() as u64, |file| {
            io::Write::write_all(file, bytes)
        })
    }

    /// Add a written file, which is synced here and listed as `written`.
    ///
    /// # Errors
    /// [`WriteError`] if it cannot be synced; the file is then removed.
    pub fn add(&mut self, mut file: AtomicFile, written: WrittenFile) -> Result<(), WriteError> {
        let synced = file.file().sync_all();
        synced.map_err(|source| file.failed(source))?;
        self.parts.push(Part::File(file));
        self.files.push(written);
        Ok(())
    }

    /// Add the files of a staging folder.
    pub(super) fn add_folder(&mut self, set: StagedSet) {
        self.files.extend(set.written());
        self.parts.push(Part::Folder(set));
    }

    /// Rename all files into place. Returns them in the order in which they were added.
    ///
    /// # Errors
    /// [`WriteError`]; all outputs are then unchanged. If undoing fails too, [`WriteError::InPart`] lists the
    /// outputs.
    pub fn commit(mut self) -> Result<Vec<WrittenFile>, WriteError> {
        for part in &self.parts {
            if let Part::Folder(set) = part {
                settled(set)?;
            }
        }
        moves::all(|moves| self.put(moves), |source| self.failed(source))?;
        Ok(std::mem::take(&mut self.files))
    }

    fn put(&self, moves: &mut Moves) -> Result<(), WriteError> {
        for part in &self.parts {
            match part {
                Part::File(file) => file.put(moves),
                Part::Folder(set) => set.put(moves),
            }?;
        }
        Ok(())
    }

    /// Convert an error of syncing the last renames.
    fn failed(&self, source: io::Error) -> WriteError {
        match self.parts.last() {
            Some(Part::File(file)) => file.failed(source),
            Some(Part::Folder(set)) => set.failed(source),
            None => unreachable!("a set without parts has no names to force to disk"),
        }
    }
}

impl Drop for FileSet {
    /// Drop in reverse order: a folder created for an earlier file may contain a later one.
    fn drop(&mut self) {
        while self.parts.pop().is_some() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::{NAMES, Product};
    use num_complex::Complex32;
    use serde_json::json;
    use std::collections::BTreeMap;
    use std::fs;
    use std::path::PathBuf;
    use subaperture_model::image::Image;

    const KIND: FileKind = FileKind::Record;

    /// Names and contents of all files under a folder, hidden ones too.
    fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => found.extend(contents(&path)),
                false => {
                    found.insert(path.clone(), fs::read(&path).unwrap());
                }
            }
        }
        found
    }

    #[test]
    fn failed_rename_restores_replaced_files_and_removes_new_ones() {
        let at = tempfile::tempdir().unwrap();
        let name = |name: &str| at.path().join(name);
        fs::write(name("old"), "old").unwrap();
        let before = contents(at.path());
        let mut files = FileSet::new();
        files.write_bytes(&name("old"), KIND, b"newer").unwrap();
        files.write_bytes(&name("new"), KIND, b"new").unwrap();
        files.write_bytes(&name("blocked"), KIND, b"third").unwrap();
        fs::create_dir(name("blocked")).unwrap();
        let error = files.commit().unwrap_err().to_string();
        assert!(
            error.contains("blocked") && error.contains("a folder of that name exists"),
            "{error}"
        );
        assert_eq!(contents(at.path()), before);

        fs::remove_dir(name("blocked")).unwrap();
        let mut files = FileSet::new();
        for file in ["old", "new", "blocked"] {
            files.write_bytes(&name(file), KIND, b"newest").unwrap();
        }
        files.commit().unwrap();
        let after = contents(at.path());
        assert_eq!(after.len(), 3);
        assert!(after.values().all(|content| content == b"newest"));
    }

    #[test]
    fn failed_rename_restores_an_older_product() {
        let at = tempfile::tempdir().unwrap();
        let folder = at.path().join("product");
        let image = |value: f32| Image {
            rows: 1,
            columns: 1,
            pixels: vec![Complex32::new(value, 0.0)],
        };
        let add = |files: &mut FileSet, value: f32, quicklook: &[u8]| {
            let (image, metadata) = (image(value), json!({ "value": value }));
            let product = Product {
                image: &image,
                metadata: &metadata,
                quicklook,
            };
            product.add_to(files, &folder).unwrap();
        };
        let mut files = FileSet::new();
        add(&mut files, 1.0, b"picture");
        files
            .write_bytes(&at.path().join("list"), KIND, b"list")
            .unwrap();
        let written = files.commit().unwrap();
        let written = written.iter().map(|file| file.path.clone());
        let names = NAMES.map(|name| folder.join(name)).into_iter();
        let list = at.path().join("list");
        assert!(written.eq(names.chain([list.clone()])));
        fs::remove_file(&list).unwrap();
        let before = contents(at.path());
        assert_eq!(before.len(), NAMES.len());

        // The set begins with a product without a picture, and a later file cannot be renamed.
        let map = at.path().join("map");
        let mut files = FileSet::new();
        add(&mut files, 2.0, b"");
        files.write_bytes(&map, KIND, b"map").unwrap();
        fs::create_dir(&map).unwrap();
        files.commit().unwrap_err();
        assert_eq!(contents(at.path()), before);

        fs::remove_dir(&map).unwrap();
        let mut files = FileSet::new();
        add(&mut files, 3.0, b"");
        files.write_bytes(&map, KIND, b"map").unwrap();
        files.commit().unwrap();
        let after = contents(at.path());
        assert!(!after.contains_key(&folder.join("image.png")));
        assert_eq!(after.len(), 3);
    }

    #[test]
    fn folders_created_for_dropped_set_are_removed() {
        let at = tempfile::tempdir().unwrap();
        let folder = at.path().join("made/deeper");
        let mut files = FileSet::new();
        files.write_bytes(&folder.join("a"), KIND, b"a").unwrap();
        files.write_bytes(&folder.join("b"), KIND, b"b").unwrap();
        drop(files);
        assert_eq!(fs::read_dir(at.path()).unwrap().count(), 0);
    }
}
