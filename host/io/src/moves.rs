//! Renames that all happen or are all undone.
//!
//! A file that is to be replaced is kept by a second name (a hard link) until all renames are done, so that its name is never without a
//! file. Where a file system has no hard links, and for folders, it is renamed aside. A process killed, or a power cut,
//! between two renames leaves some of them done.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::lock::Lock;
use super::unfinished::{self, Thing};
use super::write_error::WriteError;

/// Renames that are being made.
#[derive(Debug, Default)]
pub(super) struct Moves {
    done: Vec<Move>,
    /// Folders whose names changed since they were last forced to disk.
    changed: BTreeSet<PathBuf>,
}

/// A change of what stands at `path`.
#[derive(Debug)]
struct Move {
    path: PathBuf,
    /// Where the new content came from; `None` if `path` was only cleared.
    from: Option<PathBuf>,
    old: Old,
}

/// Where the old content of a path is kept.
#[derive(Clone, Debug)]
enum Old {
    /// No file stood there.
    Absent,
    /// Under a second name, by a hard link.
    Linked(PathBuf),
    /// Under another name alone.
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

/// An output that could not be put back.
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
                true => "a file of that name is in the way",
                false => "a folder of that name is in the way",
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

    /// Clear `path`, if a file is there.
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

    /// Force the names to disk so far.
    pub(super) fn sync(&mut self) -> io::Result<()> {
        for folder in std::mem::take(&mut self.changed) {
            sync_folder(&folder)?;
        }
        Ok(())
    }

    /// Remove the replaced files; the renames stay.
    pub(super) fn keep_new(self) {
        for old in self.done.into_iter().filter_map(|done| done.old.path()) {
            if old.is_dir() {
                unfinished::begin(Thing::Folder(old.clone()));
                let _ = fs::remove_dir_all(&old);
                unfinished::end(&old);
            } else {
                let _ = fs::remove_file(&old);
            }
        }
    }

    /// Put everything back, last first. Returns the outputs that could not be put back.
    pub(super) fn undo(self) -> Vec<NotUndone> {
        let mut left = Vec::new();
        for Move { path, from, old } in self.done.into_iter().rev() {
            let back = match (from, &old) {
                // The rename failed: the second name goes.
                (None, Old::Linked(old)) => fs::remove_file(old),
                (None, Old::Renamed(old)) => fs::rename(old, &path),
                (None, Old::Absent) => Ok(()),
                (Some(from), Old::Absent) => fs::rename(&path, from).or_else(|_| remove(&path)),
                // A folder does not replace one: the new goes first.
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

/// Make the renames of `put` and force them to disk, or undo them; `failed` is the error of forcing names to disk.
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

/// Name for the old content of `path`, which the next run that writes there removes if this one is killed.
fn aside(path: &Path, lock: &Lock) -> PathBuf {
    path.with_file_name(lock.hidden_name(".old"))
}

/// Keep the content of `path` at `old` too, or else there alone.
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

/// Forces a folder's names to disk, where the system can.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}
