//! Staging folder for a set of files that is complete or absent.
//!
//! All files are written and synced in a hidden staging folder on the same file system. Each is synced by a thread of
//! its own as soon as it is complete, so that the disk is waited for only once. Then
//! - if the folder does not exist, the staging folder is renamed to it in one step;
//! - if it exists, its other files remain. Some files are marks of a complete set: old marks are removed first, the
//!   other files are renamed into place, and the new marks last. A reader that sees a mark also sees the other files.
//!   A failed rename undoes the earlier ones.
//!
//! An error removes the staging folder. Only a killed process or a power cut leaves one (`.subap-*`), never a partial
//! set; the next run that writes there removes it. The folder is locked meanwhile.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, Write};
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use serde_json::{Value, json};

use super::atomic::{WriteError, check_room, sync_folder};
use super::input::checksum;
use super::moves::Moves;
use super::place::OutputPlace;
use super::unfinished::{self, Unfinished};
use super::written::WrittenFile;

/// Bytes written at a time: small enough to stay in the cache for the CRC-32 and the copy.
const AT_ONCE_BYTES: usize = 1 << 16;

/// Maximum number of files synced at the same time.
const MAX_FORCED: usize = 8;

/// Files to be moved into a folder. Removed when dropped without commit.
#[derive(Debug)]
pub(super) struct Staged {
    // Declared before the place, so that it is dropped before the lock and the parent folders.
    staging: Staging,
    place: OutputPlace,
    /// Path as given by the user.
    folder: PathBuf,
    needed_bytes: u64,
    /// Files being synced.
    forced: Mutex<Vec<Forced>>,
}

/// File being synced by a thread.
#[derive(Debug)]
struct Forced {
    name: String,
    done: JoinHandle<io::Result<()>>,
}

impl Staged {
    /// Begin a set of files for `folder`, which is created with its parents if missing. `needed_bytes` is the size of
    /// all files.
    ///
    /// # Errors
    /// [`WriteError`] if `folder`, or its nearest existing parent, is not writable, or if another process is writing
    /// it.
    pub(super) fn begin(folder: &Path, needed_bytes: u64) -> Result<Self, WriteError> {
        let place = OutputPlace::of_folder(folder)?;
        // Within the folder if it exists, since it can be on another disk than its parent.
        let base = match place.path.is_dir() {
            true => &place.path,
            false => place.folder(),
        };
        place.lock.sweep(base);
        let staging = base.join(place.lock.hidden_name(""));
        fs::create_dir(&staging).map_err(|source| WriteError::Io {
            path: folder.to_owned(),
            needed_bytes,
            source,
        })?;
        unfinished::begin(Unfinished::Folder(staging.clone()));
        Ok(Self {
            staging: Staging(staging),
            place,
            folder: folder.to_owned(),
            needed_bytes,
            forced: Mutex::default(),
        })
    }

    /// Check that no folder has one of these names, and that the disk has room for the files (for an ordinary user).
    pub(super) fn check<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), WriteError> {
        for name in names {
            if self.place.path.join(name).is_dir() {
                let what = "a folder of that name exists";
                let path = self.folder.join(name);
                return Err(WriteError::Blocked { path, what });
            }
        }
        check_room(&self.folder, &self.staging.0, self.needed_bytes)
    }

    /// Create a file of the set.
    pub(super) fn create(&self, name: &str) -> Result<StagedFile, WriteError> {
        let file = File::create_new(self.staging.0.join(name));
        Ok(StagedFile {
            out: BufWriter::with_capacity(
                AT_ONCE_BYTES,
                Checked {
                    file: file.map_err(|source| self.failed(name, source))?,
                    bytes: 0,
                    crc: crc32fast::Hasher::new(),
                },
            ),
        })
    }

    /// Create a file that can be written in any order and read back; [`Self::seal`] syncs it.
    pub(super) fn create_open(&self, name: &str) -> Result<File, WriteError> {
        let mut how = File::options();
        how.read(true).write(true).create_new(true);
        let file = how.open(self.staging.0.join(name));
        file.map_err(|source| self.failed(name, source))
    }

    /// Sync such a file and return its size and CRC-32. Leaves it at its start.
    pub(super) fn seal(&self, name: &str, file: &mut File) -> Result<Value, WriteError> {
        let sealed = (|| {
            file.sync_all()?;
            file.rewind()?;
            let (bytes, crc32) = checksum(file)?;
            file.rewind()?;
            Ok(json!({ "bytes": bytes, "crc32": crc32 }))
        })();
        sealed.map_err(|source| self.failed(name, source))
    }

    /// Start to sync a file, for which [`Self::commit`] waits. Returns its size and CRC-32.
    pub(super) fn finish(&self, name: &str, file: StagedFile) -> Result<Value, WriteError> {
        let (file, about) = file.end().map_err(|source| self.failed(name, source))?;
        self.force(name, file)?;
        Ok(about)
    }

    /// Start to sync a file.
    fn force(&self, name: &str, file: File) -> Result<(), WriteError> {
        let mut forced = self.forced.lock().unwrap_or_else(PoisonError::into_inner);
        if forced.len() >= MAX_FORCED {
            self.wait_for(forced.remove(0))?;
        }
        let file = Arc::new(file);
        let theirs = Arc::clone(&file);
        match thread::Builder::new().spawn(move || theirs.sync_all()) {
            Ok(done) => forced.push(Forced {
                name: name.to_owned(),
                done,
            }),
            // Immediately if no thread can be started.
            Err(_) => file
                .sync_all()
                .map_err(|source| self.failed(name, source))?,
        }
        Ok(())
    }

    fn wait_for(&self, Forced { name, done }: Forced) -> Result<(), WriteError> {
        let forced = done.join().unwrap_or_else(|panic| resume_unwind(panic));
        forced.map_err(|source| self.failed(&name, source))
    }

    /// Write a whole file. Returns its size and CRC-32.
    pub(super) fn write(
        &self,
        name: &str,
        write: impl FnOnce(&mut StagedFile) -> io::Result<()>,
    ) -> Result<Value, WriteError> {
        let mut file = self.create(name)?;
        write(&mut file).map_err(|source| self.failed(name, source))?;
        self.finish(name, file)
    }

    /// Convert an error of writing a file of this name.
    pub(super) fn failed(&self, name: &str, source: io::Error) -> WriteError {
        WriteError::Io {
            path: match name {
                "" => self.folder.clone(),
                _ => self.folder.join(name),
            },
            needed_bytes: self.needed_bytes,
            source,
        }
    }

    /// Complete the set once all files are written.
    pub(super) fn complete(self, contents: Contents) -> StagedSet {
        StagedSet {
            staged: self,
            contents,
        }
    }
}

/// Files of a staging folder. Their paths are relative to it.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// All files, marks included.
    pub(super) files: Vec<StagedEntry>,
    /// Files of an older set that the new one lacks.
    pub(super) gone: Vec<&'static str>,
}

/// File of a staging folder.
#[derive(Debug)]
pub(super) struct StagedEntry {
    pub(super) file: WrittenFile,
    /// Whether the file is a mark of a complete set; other files are replaced one by one.
    pub(super) is_mark: bool,
}

/// Staging folder with all its files.
#[derive(Debug)]
pub(super) struct StagedSet {
    staged: Staged,
    contents: Contents,
}

/// Wait until all files of a set are synced.
pub(super) fn settled(set: &StagedSet) -> Result<(), WriteError> {
    let staged = &set.staged;
    // Sync the folder while the files are being synced.
    let named = sync_folder(&staged.staging.0);
    let forced = std::mem::take(&mut *staged.forced.lock().unwrap_or_else(PoisonError::into_inner));
    for file in forced {
        staged.wait_for(file)?;
    }
    named.map_err(|source| staged.failed("", source))
}

impl StagedSet {
    /// Convert an error of moving the set.
    pub(super) fn failed(&self, source: io::Error) -> WriteError {
        self.staged.failed("", source)
    }

    /// Files of the set in their folder.
    pub(super) fn written(&self) -> impl Iterator<Item = WrittenFile> {
        let files = self.contents.files.iter();
        files.map(|entry| entry.file.clone().within(&self.staged.folder))
    }

    /// Rename the whole folder if it is new, otherwise its files: old marks are removed first and new ones renamed
    /// last.
    pub(super) fn put(&self, moves: &mut Moves) -> Result<(), WriteError> {
        self.put_all(moves).map_err(|source| self.failed(source))
    }

    fn put_all(&self, moves: &mut Moves) -> io::Result<()> {
        let place = &self.staged.place;
        let (staging, folder, lock) = (&self.staged.staging.0, &place.path, &*place.lock);
        if !folder.is_dir() {
            return moves.put(staging, folder, lock);
        }
        let Contents { files, gone } = &self.contents;
        let paths = |marks: bool| {
            let files = files.iter().filter(move |entry| entry.is_mark == marks);
            files.map(|entry| &entry.file.path)
        };
        for mark in paths(true) {
            moves.clear(&folder.join(mark), lock)?;
        }
        moves.sync()?;
        for name in gone {
            moves.clear(&folder.join(name), lock)?;
        }
        for path in paths(false) {
            moves.put(&staging.join(path), &folder.join(path), lock)?;
        }
        moves.sync()?;
        for mark in paths(true) {
            moves.put(&staging.join(mark), &folder.join(mark), lock)?;
        }
        Ok(())
    }
}

/// Staging folder, removed when dropped unless it was renamed.
#[derive(Debug)]
struct Staging(PathBuf);

impl Drop for Staging {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
        unfinished::end(&self.0);
    }
}

/// File in a staging folder.
pub(super) struct StagedFile {
    out: BufWriter<Checked>,
}

impl StagedFile {
    /// Flush the file. Returns it with its size and CRC-32.
    fn end(self) -> io::Result<(File, Value)> {
        let checked = self.out.into_inner();
        let checked = checked.map_err(io::IntoInnerError::into_error)?;
        let crc32 = format!("{:08x}", checked.crc.finalize());
        let about = json!({ "bytes": checked.bytes, "crc32": crc32 });
        Ok((checked.file, about))
    }
}

impl Write for StagedFile {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.out.write(data)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// File with the CRC-32 of the bytes written.
struct Checked {
    file: File,
    bytes: u64,
    crc: crc32fast::Hasher,
}

impl Write for Checked {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let count = self.file.write(data)?;
        self.crc.update(&data[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
