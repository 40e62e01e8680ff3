//! Registry of unfinished outputs on disk: hidden files, staging folders, locks, folders created for them.
//!
//! Each is removed when its owner is dropped. A caller that exits the process without dropping them calls
//! [`remove_all`] first.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::thread;
use std::time::{Duration, Instant};

/// Maximum time that [`remove_all`] waits for commits.
const PATIENCE: Duration = Duration::from_secs(1);

static THINGS: Mutex<Vec<Unfinished>> = Mutex::new(Vec::new());
static COMMITS: RwLock<()> = RwLock::new(());

/// Unfinished output to be removed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Unfinished {
    /// A file.
    File(PathBuf),
    /// Folder with its content.
    Folder(PathBuf),
    /// Folder, if it is empty.
    EmptyFolder(PathBuf),
}

impl Unfinished {
    fn remove(&self) {
        // Missing paths need no removal, and other errors cannot be reported since the process exits.
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

fn things() -> MutexGuard<'static, Vec<Unfinished>> {
    THINGS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Register `thing`, which exists or is about to be created.
pub(super) fn begin(thing: Unfinished) {
    things().push(thing);
}

/// Unregister `path`, which was removed or has become an output.
pub(super) fn end(path: &Path) {
    let mut things = things();
    if let Some(last) = things.iter().rposition(|thing| thing.path() == path) {
        things.remove(last);
    }
}

/// Guard held while files are renamed into place; [`remove_all`] waits for it.
pub(super) fn commit() -> RwLockReadGuard<'static, ()> {
    COMMITS.read().unwrap_or_else(PoisonError::into_inner)
}

/// Remove everything unfinished, newest first, before the process exits. Waits for commits in progress, at most a
/// second, and blocks new ones.
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
    // Never released, since the process exits.
    std::mem::forget(held);
}
