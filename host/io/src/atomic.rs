//! Atomic file output: a hidden file in the same folder is renamed into place.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::lock::KEPT_SUFFIX;
use super::moves::{self, Moves};
use super::place::OutputPlace;
use super::unfinished::{self, Thing};

pub use super::moves::sync_folder;
pub use super::write_error::WriteError;

/// Write one file atomically: `write` fills a hidden file in the same folder, which is forced to disk
/// and then renamed to `path`. `needed_bytes` is for the message of a full disk; 0 if not known.
/// A symbolic link is followed; missing folders are made.
///
/// # Errors
/// [`WriteError`]; then `path` is unchanged and the hidden file is removed.
pub fn write_atomically<T>(
    path: &Path,
    needed_bytes: u64,
    write: impl FnOnce(&mut File) -> io::Result<T>,
) -> Result<T, WriteError> {
    let mut beside = AtomicFile::create(path, needed_bytes, ".part")?;
    let value = write(beside.file()).map_err(|source| beside.failed(source))?;
    beside.commit()?;
    Ok(value)
}

/// A hidden file in the folder of its target, which is locked meanwhile. Gone when dropped, unless committed.
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    // Before the place: when dropped, the file goes before the lock and the folder.
    hidden: Hidden,
    place: OutputPlace,
    /// As the user calls it.
    path: PathBuf,
    needed_bytes: u64,
}

impl AtomicFile {
    /// Begins a file that is to become `path`. A symbolic link is followed, missing folders are made. The hidden
    /// file's name ends in `suffix`.
    ///
    /// # Errors
    /// If the folder cannot be written to, has less than `needed_bytes` free, `path` exists and is not a file, or
    /// another process is writing it.
    pub fn create(path: &Path, needed_bytes: u64, suffix: &str) -> Result<Self, WriteError> {
        let place = OutputPlace::of_file(path)?;
        check_room(path, place.folder(), needed_bytes)?;
        let hidden = place.folder().join(place.lock.hidden_name(suffix));
        let file = File::create_new(&hidden).map_err(|source| WriteError::Io {
            path: path.to_owned(),
            needed_bytes,
            source,
        })?;
        // What is kept of a killed run is kept of one that ends at once too.
        if suffix != KEPT_SUFFIX {
            unfinished::begin(Thing::File(hidden.clone()));
        }
        Ok(Self {
            file,
            hidden: Hidden(hidden),
            place,
            path: path.to_owned(),
            needed_bytes,
        })
    }

    /// The file to be filled.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// The error of writing it.
    pub fn failed(&self, source: io::Error) -> WriteError {
        WriteError::Io {
            path: self.path.clone(),
            needed_bytes: self.needed_bytes,
            source,
        }
    }

    /// Forces the file to disk and renames it into place.
    ///
    /// # Errors
    /// Then the target is as it was.
    pub fn commit(self) -> Result<(), WriteError> {
        let synced = self.file.sync_all();
        synced.map_err(|source| self.failed(source))?;
        moves::all(|moves| self.put(moves), |source| self.failed(source))
    }

    /// Rename the file, which was forced to disk, into place.
    pub(super) fn put(&self, moves: &mut Moves) -> Result<(), WriteError> {
        let put = moves.put(&self.hidden.0, &self.place.path, &self.place.lock);
        put.map_err(|source| self.failed(source))
    }
}

/// A hidden file, removed when dropped, if it is still there.
#[derive(Debug)]
struct Hidden(PathBuf);

impl Drop for Hidden {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
        unfinished::end(&self.0);
    }
}

/// Free space for an ordinary user at `path`, bytes; `None` where the system does not report it.
pub fn free_bytes(path: &Path) -> Option<u64> {
    let path = std::path::absolute(path).ok()?;
    let place = path.ancestors().find(|place| place.is_dir())?;
    fs4::available_space(place).ok()
}

/// Refuse an output larger than the free space for an ordinary user in `folder`. Where the system does not report it, writing
/// will.
pub fn check_room(path: &Path, folder: &Path, needed_bytes: u64) -> Result<(), WriteError> {
    match fs4::available_space(folder) {
        Ok(free_bytes) if free_bytes < needed_bytes => Err(WriteError::NoSpace {
            path: path.to_owned(),
            needed_bytes,
            free_bytes,
        }),
        _ => Ok(()),
    }
}

/// Forces the `file` called `hidden` to disk and renames it to `path`, in the same folder.
pub(super) fn put_in_place(file: &File, hidden: &Path, path: &Path) -> io::Result<()> {
    file.sync_all()?;
    let _moving = unfinished::commit();
    fs::rename(hidden, path)?;
    sync_folder(path.parent().unwrap_or(Path::new("")))
}
