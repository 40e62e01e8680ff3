//! Advisory locks on outputs, so that two runs never write the same output at the same time.
//!
//! A lock is a hidden file `.subap-KEY.lock` in the output's folder, where KEY is the CRC-32 of the output's name.
//! The system keeps it locked while the run lives (`flock`). A killed run leaves the file but not the lock. The next
//! run therefore recognises an unlocked file as that of a dead run, and removes it with the run's partial files,
//! `.subap-KEY-*`. Nothing else is removed.
//!
//! Within one process a lock is shared: a writer can take a lock that its caller holds. On file systems without
//! locks, outputs are written without.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use super::unfinished::{self, Unfinished};

/// Prefix of the names of hidden files.
const PREFIX: &str = ".subap-";
const LOCK_SUFFIX: &str = ".lock";

/// Suffix of files that remain after their writer was killed, since they can be read up to the end of their content.
pub const KEPT_SUFFIX: &str = ".maps.part";

/// Number of attempts at a lock that is held briefly, and the pause between them.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(5);

/// Locks of this process.
static HELD: Mutex<BTreeMap<PathBuf, Weak<Lock>>> = Mutex::new(BTreeMap::new());

/// Counter for unique names of this process's hidden files.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// Lock on an output, released when dropped.
#[derive(Debug)]
pub struct Lock {
    /// Path of the lock's file.
    path: PathBuf,
    key: String,
    file: Option<File>,
}

/// Error of taking a lock.
#[non_exhaustive]
pub enum LockError {
    /// Another process holds the lock; its description.
    Busy(String),
    /// The operating system reported an error.
    Io(io::Error),
}

impl From<io::Error> for LockError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl Lock {
    /// Lock the output `name` in `folder`, which must be canonical, and remove partial files of dead runs.
    pub fn take(folder: &Path, name: &OsStr) -> Result<Arc<Self>, LockError> {
        let key = format!("{:08x}", crc32fast::hash(name.as_encoded_bytes()));
        let path = folder.join(format!("{PREFIX}{key}{LOCK_SUFFIX}"));
        let mut tries = 0;
        loop {
            {
                let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(lock) = held.get(&path).and_then(Weak::upgrade) {
                    return Ok(lock);
                }
                match acquire(&path)? {
                    Attempt::Locked(file) => {
                        let lock = Arc::new(Self {
                            path: path.clone(),
                            key,
                            file,
                        });
                        unfinished::begin(Unfinished::File(path.clone()));
                        held.insert(path, Arc::downgrade(&lock));
                        drop(held);
                        lock.sweep(folder);
                        return Ok(lock);
                    }
                    Attempt::Busy(holder) if tries >= TRIES => return Err(LockError::Busy(holder)),
                    Attempt::Busy(_) | Attempt::Again => {}
                }
            }
            tries += 1;
            std::thread::sleep(PAUSE);
        }
    }

    /// Unique name for a hidden file or folder of this output.
    pub fn hidden_name(&self, suffix: &str) -> String {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let process = std::process::id();
        format!("{PREFIX}{}-{process}-{number}{suffix}", self.key)
    }

    /// Remove partial files of dead runs of this output from `folder`, and locks of dead runs with their files.
    pub fn sweep(&self, folder: &Path) {
        if self.file.is_some() {
            // This process may hold a lock on an output of this name in another folder, not in this one.
            remove_leftovers(folder, &self.key);
        }
        sweep_dead(folder);
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // The table is locked, so that no thread of this process requests the lock meanwhile.
        let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        held.remove(&self.path);
        let _ = fs::remove_file(&self.path);
        unfinished::end(&self.path);
        self.file = None;
    }
}

enum Attempt {
    /// `None` where the file system has no locks.
    Locked(Option<File>),
    Busy(String),
    /// Another process took or released the lock during the attempt.
    Again,
}

/// Try to lock once. An unlocked file belongs to a dead run: it is removed, and the next attempt creates a new one.
fn acquire(path: &Path) -> io::Result<Attempt> {
    match File::create_new(path) {
        Ok(mut file) => match file.try_lock() {
            Ok(()) if is_at(&file, path) => {
                // Shown to users, and in the error of a process that cannot take the lock.
                let _ = writeln!(file, "subap, process {}", std::process::id());
                Ok(Attempt::Locked(Some(file)))
            }
            Ok(()) | Err(TryLockError::WouldBlock) => Ok(Attempt::Again),
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                let _ = fs::remove_file(path);
                Ok(Attempt::Locked(None))
            }
            Err(TryLockError::Error(error)) => {
                let _ = fs::remove_file(path);
                Err(error)
            }
        },
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => match dead(path)? {
            Found::Dead(_held) => {
                let _ = fs::remove_file(path);
                Ok(Attempt::Again)
            }
            Found::Alive(holder) => Ok(Attempt::Busy(holder)),
            Found::Gone => Ok(Attempt::Again),
        },
        Err(error) => Err(error),
    }
}

enum Found {
    /// The lock was free and is held until dropped.
    Dead(File),
    /// Description of the process that holds the lock.
    Alive(String),
    Gone,
}

/// Whether a lock's file belongs to a dead run.
fn dead(path: &Path) -> io::Result<Found> {
    match fs::symlink_metadata(path) {
        Ok(about) if about.is_file() => {}
        Ok(_) => {
            let what = format!("{} is not a lock file: remove it", path.display());
            return Err(io::Error::other(what));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Gone),
        Err(error) => return Err(error),
    }
    let file = match OpenOptions::new().read(true).write(true).open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Gone),
        Err(error) => return Err(error),
    };
    match file.try_lock() {
        Ok(()) if is_at(&file, path) => Ok(Found::Dead(file)),
        Ok(()) => Ok(Found::Gone),
        Err(TryLockError::WouldBlock) => {
            let mut text = String::new();
            let _ = (&file).take(100).read_to_string(&mut text);
            let text = text.trim();
            Ok(Found::Alive(match text {
                "" => "subap".to_owned(),
                _ => text.to_owned(),
            }))
        }
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Whether `path` still leads to `file`.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(named)) => super::input::same_file(&open, &named),
        _ => false,
    }
}

/// Remove locks and partial files of dead runs.
fn sweep_dead(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(key) = name.to_str().and_then(key_of_lock) else {
            continue;
        };
        let path = entry.path();
        // A lock of this process is alive, whatever the system reports for a second lock by the same process.
        let own = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        if own.contains_key(&path) {
            continue;
        }
        if let Ok(Found::Dead(_file)) = dead(&path) {
            remove_leftovers(folder, key);
            let _ = fs::remove_file(&path);
        }
    }
}

/// Key in the name of a lock file.
fn key_of_lock(name: &str) -> Option<&str> {
    let key = name.strip_prefix(PREFIX)?.strip_suffix(LOCK_SUFFIX)?;
    let is_hex = key.len() == 8 && key.bytes().all(|b| b.is_ascii_hexdigit());
    is_hex.then_some(key)
}

/// Remove files with the prefix of a key, except those that can still be read.
fn remove_leftovers(folder: &Path, key: &str) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    let prefix = format!("{PREFIX}{key}-");
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        if !name.starts_with(&prefix) || name.ends_with(KEPT_SUFFIX) {
            continue;
        }
        let _ = match entry.file_type() {
            Ok(kind) if kind.is_dir() => fs::remove_dir_all(entry.path()),
            _ => fs::remove_file(entry.path()),
        };
    }
}
