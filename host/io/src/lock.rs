//! Advisory locks on outputs, so that two runs never write the same output at once.
//!
//! A lock is a hidden file beside the output, `.subap-KEY.lock`, with KEY the CRC-32 of the output's name, that the system
//! keeps locked for as long as the run lives (`flock`). A killed run leaves the file but not the lock: whoever finds
//! a file that is not locked knows that its run is dead, and removes it with what that run left half-written,
//! `.subap-KEY-*`. Nothing else is ever removed.
//!
//! Within one process a lock is shared: what a command holds from its first check on, the writers called by it hold
//! again. Where a file system has no locks, outputs are written without.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use super::unfinished::{self, Thing};

/// What a name of ours begins with.
const PREFIX: &str = ".subap-";
const LOCK_SUFFIX: &str = ".lock";

/// What ends the name of a file that stays when its writer was killed: it can be read up to where it breaks off.
pub const KEPT_SUFFIX: &str = ".maps.part";

/// Number of attempts at a lock that is held briefly, and the pause between them.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(5);

/// The locks of this process.
static HELD: Mutex<BTreeMap<PathBuf, Weak<Lock>>> = Mutex::new(BTreeMap::new());

/// Numbers hidden files of this process.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// A lock. Gone when dropped.
#[derive(Debug)]
pub struct Lock {
    /// Its file.
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
    /// Locks the output `name` in `folder`, which must be canonical, and removes what dead runs left there.
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
                        unfinished::begin(Thing::File(path.clone()));
                        held.insert(path, Arc::downgrade(&lock));
                        drop(held);
                        lock.sweep(folder);
                        sweep_dead(folder);
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

    /// Removes from `folder` what dead runs left of this output.
    pub fn sweep(&self, folder: &Path) {
        if self.file.is_some() {
            // This process may write another output of the same name in another folder, not here.
            remove_leftovers(folder, &self.key);
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // While nobody of this process can ask for it.
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
                // For people, and for who finds it held.
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
    /// Who holds it.
    Alive(String),
    Gone,
}

/// Whether the run of a lock's file is dead.
fn dead(path: &Path) -> io::Result<Found> {
    match fs::symlink_metadata(path) {
        Ok(about) if about.is_file() => {}
        Ok(_) => {
            let what = format!("{} is in the way: remove it", path.display());
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

/// Whether `file` is still what stands at `path`.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(named)) => super::input::same_file(&open, &named),
        _ => false,
    }
}

/// Removes locks of dead runs and what they left.
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
        // Of this process: alive, whatever the system says of a second lock by the same process.
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

/// The key of a lock's name.
fn key_of_lock(name: &str) -> Option<&str> {
    let key = name.strip_prefix(PREFIX)?.strip_suffix(LOCK_SUFFIX)?;
    let is_hex = key.len() == 8 && key.bytes().all(|b| b.is_ascii_hexdigit());
    is_hex.then_some(key)
}

/// Removes what begins with a key's prefix, but for what can still be read.
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
