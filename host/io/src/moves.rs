//! Renames that succeed together or are undone.
//!
//! A file to be replaced keeps a second name (a hard link) until all renames are done, so that its path always has a
//! file. Folders, and files on file systems without hard links, are renamed aside. If the process is killed, or power
//! fails, between two renames, only some of them are done.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::lock::Lock;
use super::unfinished::{self, Unfinished};
use super::write_error::WriteError;

/// Renames in progress.
#[derive(Debug, Default)]
pub(super) struct Moves {
    done: Vec<Move>,
    /// Folders with changed names since the last sync.
    changed: BTreeSet<PathBuf>,
}

/// Change of the content of `path`.
#[derive(Debug)]
struct Move {
    path: PathBuf,
    /// Source of the new content. `None` if `path` was only cleared.
    from: Option<PathBuf>,
    old: Old,
}

/// Old content of a path.
#[derive(Clone, Debug)]
enum Old {
    /// There was no file.
    Absent,
    /// Under a second name (hard link).
    Linked(PathBuf),
    /// Under another name only.
    Renamed(PathBuf),
}

impl Old {
    fn path(self) -> Option<PathBuf> {
        match self {
            Self::Absent => None,
            Self::Linked(path) | Self::Renamed(path) => Some(path),
        }
    }
}

/// Output that could not be restored.
#[derive(Debug)]
pub(super) struct NotUndone {
    pub(super) path: PathBuf,
    /// Path of the old content.
    pub(super) old: Option<PathBuf>,
}

impl Moves {
    /// Rename `from` to `path`, in the same folder or a folder above; `lock` is that of the output.
    pub(super) fn put(&mut self, from: &Path, path: &Path, lock: &Lock) -> io::Result<()> {
        if path.exists() && path.is_dir() != from.is_dir() {
            return Err(io::Error::other(match from.is_dir() {
                true => "a file of that name exists",
                false => "a folder of that name exists",
            }));
        }
        let old = keep(path, &aside(path, lock))?;
        self.changed.extend(path.parent().map(Path::to_owned));
        match fs::rename(from, path) {
            Ok(()) => {
                self.done.push(Move {
                    path: path.to_owned(),
                    from: Some(from.to_owned()),
                    old,
                });
                Ok(())
            }
            Err(error) => {
                self.done.push(Move {
                    path: path.to_owned(),
                    from: None,
                    old,
                });
                Err(error)
            }
        }
    }

    /// Clear `path` if it is a file.
    pub(super) fn clear(&mut self, path: &Path, lock: &Lock) -> io::Result<()> {
        let old = aside(path, lock);
        match fs::rename(path, &old) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error),
        }
        self.changed.extend(path.parent().map(Path::to_owned));
        self.done.push(Move {
            path: path.to_owned(),
            from: None,
            old: Old::Renamed(old),
        });
        Ok(())
    }

    /// Sync the folders of all renames so far.
    pub(super) fn sync(&mut self) -> io::Result<()> {
        for folder in std::mem::take(&mut self.changed) {
            sync_folder(&folder)?;
        }
        Ok(())
    }

    /// Remove the replaced files and keep the renames.
    pub(super) fn keep_new(self) {
        for old in self.done.into_iter().filter_map(|done| done.old.path()) {
            if old.is_dir() {
                unfinished::begin(Unfinished::Folder(old.clone()));
                let _ = fs::remove_dir_all(&old);
                unfinished::end(&old);
            } else {
                let _ = fs::remove_file(&old);
            }
        }
    }

    /// Undo the renames in reverse order. Returns the outputs that could not be restored.
    pub(super) fn undo(self) -> Vec<NotUndone> {
        let mut left = Vec::new();
        for Move { path, from, old } in self.done.into_iter().rev() {
            let back = match (from, &old) {
                // The rename failed: remove the second name.
                (None, Old::Linked(old)) => fs::remove_file(old),
                (None, Old::Renamed(old)) => fs::rename(old, &path),
                (None, Old::Absent) => Ok(()),
                (Some(from), Old::Absent) => fs::rename(&path, from).or_else(|_| remove(&path)),
                // A rename cannot replace a folder by a folder, so remove the new one first.
                (Some(from), Old::Renamed(old)) if old.is_dir() => {
                    fs::rename(&path, from).and_then(|()| fs::rename(old, &path))
                }
                (Some(_), Old::Linked(old) | Old::Renamed(old)) => fs::rename(old, &path),
            };
            if back.is_err() {
                left.push(NotUndone {
                    path,
                    old: old.path(),
                });
            }
        }
        left
    }
}

/// Make the renames of `put` and sync them, or undo them; `failed` converts an error of syncing.
pub(super) fn all(
    put: impl FnOnce(&mut Moves) -> Result<(), WriteError>,
    failed: impl FnOnce(io::Error) -> WriteError,
) -> Result<(), WriteError> {
    let _moving = unfinished::commit();
    let mut moves = Moves::default();
    match put(&mut moves).and_then(|()| moves.sync().map_err(failed)) {
        Ok(()) => {
            moves.keep_new();
            Ok(())
        }
        Err(error) => Err(after_undo(moves, error)),
    }
}

/// Undo the renames. Returns `error`, with the renames that could not be undone.
fn after_undo(moves: Moves, error: WriteError) -> WriteError {
    let left = moves.undo();
    if left.is_empty() {
        return error;
    }
    let mut replaced: Vec<PathBuf> = Vec::new();
    let mut kept: Vec<PathBuf> = Vec::new();
    for one in left {
        replaced.push(one.path);
        kept.extend(one.old);
    }
    WriteError::InPart {
        error: Box::new(error),
        replaced,
        kept,
    }
}

/// Name for the old content of `path`. If this run is killed, the next run that writes there removes it.
fn aside(path: &Path, lock: &Lock) -> PathBuf {
    path.with_file_name(lock.hidden_name(".old"))
}

/// Keep the content of `path` under the name `old` as well, or only there.
fn keep(path: &Path, old: &Path) -> io::Result<Old> {
    if fs::hard_link(path, old).is_ok() {
        return Ok(Old::Linked(old.to_owned()));
    }
    match fs::rename(path, old) {
        Ok(()) => Ok(Old::Renamed(old.to_owned())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Old::Absent),
        Err(error) => Err(error),
    }
}

fn remove(path: &Path) -> io::Result<()> {
    match path.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    }
}

/// Sync a folder, if the system supports it.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    fs::File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}
