//! What of outputs is on the disk and is no output yet: hidden files, staging folders, locks, folders made for them.
//!
//! Each is removed by its owner when that is dropped. Who ends the process at once drops nothing, and calls
//! [`remove_all`] before.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::thread;
use std::time::{Duration, Instant};

/// Longest that [`remove_all`] waits for files on their way into place.
const PATIENCE: Duration = Duration::from_secs(1);

static THINGS: Mutex<Vec<Thing>> = Mutex::new(Vec::new());
static COMMITS: RwLock<()> = RwLock::new(());

/// Something to be removed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Thing {
    /// A file.
    File(PathBuf),
    /// A folder with all that is in it.
    Folder(PathBuf),
    /// A folder, if nothing is in it.
    EmptyFolder(PathBuf),
}

impl Thing {
    fn remove(&self) {
        // What is not there any more needs no removing, and what cannot be removed is told by nobody: the
        // process ends.
        let _ = match self {
            Self::File(path) => fs::remove_file(path),
            Self::Folder(path) => fs::remove_dir_all(path),
            Self::EmptyFolder(path) => fs::remove_dir(path),
        };
    }

    fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Folder(path) | Self::EmptyFolder(path) => path,
        }
    }
}

fn things() -> MutexGuard<'static, Vec<Thing>> {
    THINGS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// There is `thing` now, or will be in a moment.
pub(super) fn begin(thing: Thing) {
    things().push(thing);
}

/// There is nothing unfinished at `path` any more: it was removed, or is an output.
pub(super) fn end(path: &Path) {
    let mut things = things();
    if let Some(last) = things.iter().rposition(|thing| thing.path() == path) {
        things.remove(last);
    }
}

/// While this lives, files that belong together are on their way into place, and [`remove_all`] waits.
pub(super) fn commit() -> RwLockReadGuard<'static, ()> {
    COMMITS.read().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all that is unfinished, the newest first; for who ends the process next. Waits for files on their way into
/// place, a second at most, and lets none set out any more.
pub fn remove_all() {
    let begun = Instant::now();
    let held = loop {
        if let Ok(held) = COMMITS.try_write() {
            break Some(held);
        }
        if begun.elapsed() > PATIENCE {
            break None;
        }
        thread::sleep(PATIENCE / 100);
    };
    for thing in things().drain(..).rev() {
        thing.remove();
    }
    // For as long as the process has.
    std::mem::forget(held);
}
