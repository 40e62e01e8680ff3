//! Atomic file output: a hidden file in the same folder is renamed into place.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::lock::KEPT_SUFFIX;
use super::moves::{self, Moves};
use super::place::OutputPlace;
use super::unfinished::{self, Unfinished};

pub use super::moves::sync_folder;
pub use super::write_error::WriteError;

/// Write one file atomically: `write` fills a hidden file in the same folder, which is synced and renamed to `path`.
/// `needed_bytes` (0 if unknown) is stated in the error of a full disk. Symbolic links are followed; missing folders
/// are created.
///
/// # Errors
/// [`WriteError`]; `path` is then unchanged and the hidden file is removed.
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

/// Hidden file in its target's folder, which stays locked. Removed when dropped without commit.
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    // Declared before the place, so that it is dropped before the lock and the folder.
    hidden: Hidden,
    place: OutputPlace,
    /// Path as given by the user.
    path: PathBuf,
    needed_bytes: u64,
}

impl AtomicFile {
    /// Create a hidden file that will replace `path`. Symbolic links are followed; missing folders are created. The
    /// name of the hidden file ends in `suffix`.
    ///
    /// # Errors
    /// [`WriteError`] if the folder is not writable or has less than `needed_bytes` free, if `path` exists and is not
    /// a file, or if another process is writing it.
    pub fn create(path: &Path, needed_bytes: u64, suffix: &str) -> Result<Self, WriteError> {
        let place = OutputPlace::of_file(path)?;
        check_room(path, place.folder(), needed_bytes)?;
        let hidden = place.folder().join(place.lock.hidden_name(suffix));
        let file = File::create_new(&hidden).map_err(|source| WriteError::Io {
            path: path.to_owned(),
            needed_bytes,
            source,
        })?;
        // Resumable files of killed runs remain also after runs that fail at once.
        if suffix != KEPT_SUFFIX {
            unfinished::begin(Unfinished::File(hidden.clone()));
        }
        Ok(Self {
            file,
            hidden: Hidden(hidden),
            place,
            path: path.to_owned(),
            needed_bytes,
        })
    }

    /// Hidden file to be filled.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Convert an error of writing the file.
    pub fn failed(&self, source: io::Error) -> WriteError {
        WriteError::Io {
            path: self.path.clone(),
            needed_bytes: self.needed_bytes,
            source,
        }
    }

    /// Sync the file and rename it to its target.
    ///
    /// # Errors
    /// [`WriteError`]; the target is then unchanged.
    pub fn commit(self) -> Result<(), WriteError> {
        let synced = self.file.sync_all();
        synced.map_err(|source| self.failed(source))?;
        moves::all(|moves| self.put(moves), |source| self.failed(source))
    }

    /// Rename the synced file to its target.
    pub(super) fn put(&self, moves: &mut Moves) -> Result<(), WriteError> {
        let put = moves.put(&self.hidden.0, &self.place.path, &self.place.lock);
        put.map_err(|source| self.failed(source))
    }
}

/// Path of a hidden file that is removed when dropped.
#[derive(Debug)]
struct Hidden(PathBuf);

impl Drop for Hidden {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
        unfinished::end(&self.0);
    }
}

/// Free space at `path` for an ordinary user in bytes. `None` if the system does not report it.
pub fn free_bytes(path: &Path) -> Option<u64> {
    let path = std::path::absolute(path).ok()?;
    let place = path.ancestors().find(|place| place.is_dir())?;
    available_bytes(place)
}

/// Free space of an existing folder, bytes.
fn available_bytes(folder: &Path) -> Option<u64> {
    #[cfg(not(target_family = "wasm"))]
    return fs4::available_space(folder).ok();
    #[cfg(target_family = "wasm")]
    {
        let _ = folder;
        None
    }
}

/// Check that `folder` has room for an output, as far as the system reports its free space to ordinary users.
pub fn check_room(path: &Path, folder: &Path, needed_bytes: u64) -> Result<(), WriteError> {
    match available_bytes(folder) {
        Some(free_bytes) if free_bytes < needed_bytes => Err(WriteError::NoSpace {
            path: path.to_owned(),
            needed_bytes,
            free_bytes,
        }),
        _ => Ok(()),
    }
}

/// Sync `file` and rename it from `hidden` to `path` in the same folder.
pub(super) fn put_in_place(file: &File, hidden: &Path, path: &Path) -> io::Result<()> {
    file.sync_all()?;
    let _moving = unfinished::commit();
    fs::rename(hidden, path)?;
    sync_folder(path.parent().unwrap_or(Path::new("")))
}
