//! Staging folder for a set of files that appears complete or not at all.
//!
//! All files are written, and forced to disk, in a hidden staging folder on the same file system: each by a thread of its own as
//! soon as it is whole, so that the disk is waited for once and not for each. Then
//! - if the folder does not exist, the staging folder is renamed to it: one step;
//! - if it exists, whatever else lies in it stays. Some of the files are marks of a whole set: old ones are removed
//!   first, the others are renamed into place, and the new marks last. Whoever finds a mark finds the others. A failed rename
//!   undoes the earlier ones.
//!
//! An error on the way removes the staging folder; only a killed process or a power cut leaves one (`.subap-*`),
//! never a set in part, and the next run that writes there removes it. Meanwhile the folder is locked.

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
use super::unfinished::{self, Thing};

/// What is handed to the system at once: as much as stays in the cache between what makes it, its CRC-32 and its copy.
const AT_ONCE_BYTES: usize = 1 << 16;

/// Files that are forced to the disk at a time, at most.
const MAX_FORCED: usize = 8;

/// Files on their way into a folder. Gone when dropped, unless committed.
#[derive(Debug)]
pub(super) struct Staged {
    // Before the place: when dropped, it goes before the lock and the folders above.
    staging: Staging,
    place: OutputPlace,
    /// As the user calls it.
    folder: PathBuf,
    needed_bytes: u64,
    /// What is being forced to the disk.
    forced: Mutex<Vec<Forced>>,
}

/// A file that is being forced to the disk.
#[derive(Debug)]
struct Forced {
    name: String,
    done: JoinHandle<io::Result<()>>,
}

impl Staged {
    /// Begins files that are to lie in `folder`, which is made if need be, with its parents. `needed_bytes` is
    /// the size of them all.
    ///
    /// # Errors
    /// [`WriteError`] if `folder`, or its nearest existing parent, cannot be written to, or another process is
    /// writing it.
    pub(super) fn begin(folder: &Path, needed_bytes: u64) -> Result<Self, WriteError> {
        let place = OutputPlace::of_folder(folder)?;
        // In the folder itself, which may be another disk than its parent.
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
        unfinished::begin(Thing::Folder(staging.clone()));
        Ok(Self {
            staging: Staging(staging),
            place,
            folder: folder.to_owned(),
            needed_bytes,
            forced: Mutex::default(),
        })
    }

    /// Check that no folder occupies one of these names, and that the disk has room for them (as an
    /// ordinary user sees it).
    pub(super) fn check<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), WriteError> {
        for name in names {
            if self.place.path.join(name).is_dir() {
                let what = "a folder of that name is in the way";
                let path = self.folder.join(name);
                return Err(WriteError::Blocked { path, what });
            }
        }
        check_room(&self.folder, &self.staging.0, self.needed_bytes)
    }

    /// A file to be filled.
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

    /// A file to be filled in any order, to be read meanwhile too; it is forced to the disk by [`Self::seal`].
    pub(super) fn create_open(&self, name: &str) -> Result<File, WriteError> {
        let mut how = File::options();
        how.read(true).write(true).create_new(true);
        let file = how.open(self.staging.0.join(name));
        file.map_err(|source| self.failed(name, source))
    }

    /// Forces such a file to the disk; its size and CRC-32. Leaves it at its start.
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

    /// Has a file forced to the disk, not only to the system's memory, for which [`Self::commit`] waits; its size and CRC-32.
    pub(super) fn finish(&self, name: &str, file: StagedFile) -> Result<Value, WriteError> {
        let (file, about) = file.end().map_err(|source| self.failed(name, source))?;
        self.force(name, file)?;
        Ok(about)
    }

    /// Begins to force a file to the disk.
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
            // At once, where there is no other thread.
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

    /// Writes a whole file; its size and CRC-32.
    pub(super) fn write(
        &self,
        name: &str,
        write: impl FnOnce(&mut StagedFile) -> io::Result<()>,
    ) -> Result<Value, WriteError> {
        let mut file = self.create(name)?;
        write(&mut file).map_err(|source| self.failed(name, source))?;
        self.finish(name, file)
    }

    /// The error of writing a file of this name.
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

    /// The files, all of which are written.
    pub(super) fn complete(self, names: Names) -> StagedSet {
        StagedSet {
            staged: self,
            names,
        }
    }
}

/// Names of the files of a staging folder.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// Files that are replaced one by one.
    pub(super) files: Vec<String>,
    /// Marks of a whole set.
    pub(super) marks: Vec<String>,
    /// Files of an older set that the new one does not have.
    pub(super) gone: Vec<String>,
}

/// A staging folder with all its files.
#[derive(Debug)]
pub(super) struct StagedSet {
    staged: Staged,
    names: Names,
}

/// Wait until all files of a set are forced to disk.
pub(super) fn settled(set: &StagedSet) -> Result<(), WriteError> {
    let staged = &set.staged;
    // The names, while the files are forced to disk.
    let named = sync_folder(&staged.staging.0);
    let forced = std::mem::take(&mut *staged.forced.lock().unwrap_or_else(PoisonError::into_inner));
    for file in forced {
        staged.wait_for(file)?;
    }
    named.map_err(|source| staged.failed("", source))
}

impl StagedSet {
    /// The error of moving it.
    pub(super) fn failed(&self, source: io::Error) -> WriteError {
        self.staged.failed("", source)
    }

    /// Renames the whole folder where it is new, else the files over those of the folder: marks first off and last on.
    pub(super) fn put(&self, moves: &mut Moves) -> Result<(), WriteError> {
        self.put_all(moves).map_err(|source| self.failed(source))
    }

    fn put_all(&self, moves: &mut Moves) -> io::Result<()> {
        let place = &self.staged.place;
        let (staging, folder, lock) = (&self.staged.staging.0, &place.path, &*place.lock);
        if !folder.is_dir() {
            return moves.put(staging, folder, lock);
        }
        let Names { files, marks, gone } = &self.names;
        for mark in marks {
            moves.clear(&folder.join(mark), lock)?;
        }
        moves.sync()?;
        for name in gone {
            moves.clear(&folder.join(name), lock)?;
        }
        for name in files {
            moves.put(&staging.join(name), &folder.join(name), lock)?;
        }
        moves.sync()?;
        for mark in marks {
            moves.put(&staging.join(mark), &folder.join(mark), lock)?;
        }
        Ok(())
    }
}

/// A staging folder, removed when dropped, if it is still there.
#[derive(Debug)]
struct Staging(PathBuf);

impl Drop for Staging {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
        unfinished::end(&self.0);
    }
}

/// A file in a staging folder.
pub(super) struct StagedFile {
    out: BufWriter<Checked>,
}

impl StagedFile {
    /// The file with all that was written, and its size and CRC-32.
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

/// A file and the CRC-32 of what went into it.
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
