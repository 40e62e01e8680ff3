//! Place of an output: symbolic links followed, parent folder created, locked against other runs.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::lock::{Lock, LockError};
use super::unfinished::{self, Unfinished};
use super::write_error::WriteError;

/// Maximum number of symbolic links followed.
const MAX_LINKS: usize = 40;

/// Place of an output. Dropping it releases the lock and removes the parent folders created for it, if they are
/// empty.
#[derive(Debug)]
pub(super) struct OutputPlace {
    /// Absolute path that is not a symbolic link.
    pub(super) path: PathBuf,
    pub(super) lock: Arc<Lock>,
    _made: Made,
}

impl OutputPlace {
    /// Place of a file.
    pub(super) fn of_file(path: &Path) -> Result<Self, WriteError> {
        if path.as_os_str().as_encoded_bytes().ends_with(b"/") {
            return Err(blocked(
                path,
                "expected the path of a file, found that of a folder",
            ));
        }
        let (target, linked) = followed(path).map_err(|source| failed(path, source))?;
        match fs::metadata(&target) {
            Ok(about) if about.is_file() => {}
            Ok(_) => {
                return Err(blocked(
                    path,
                    "expected a file or a new path, found something else",
                ));
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {}
            Err(source) => return Err(failed(path, source)),
        }
        Self::within(path, &target, linked)
    }

    /// Place of a folder, which may exist.
    pub(super) fn of_folder(path: &Path) -> Result<Self, WriteError> {
        let (target, linked) = followed(path).map_err(|source| failed(path, source))?;
        match fs::metadata(&target) {
            Ok(about) if about.is_dir() => {
                let real = fs::canonicalize(&target).map_err(|source| failed(path, source))?;
                // A mounted folder may lie in a folder that is not writable.
                Self::within(path, &real, true).or_else(|error| match error {
                    WriteError::Io { .. } => Ok(Self {
                        lock: locked(path, &real, std::ffi::OsStr::new("."))?,
                        path: real,
                        _made: Made::default(),
                    }),
                    other => Err(other),
                })
            }
            Ok(_) => Err(blocked(path, NO_FOLDER)),
            Err(_) => Self::within(path, &target, linked),
        }
    }

    /// Place of `target`, for which the user gave `path`, in its folder. The folder is created unless a link leads
    /// there, since the link may lead to a disk that is not mounted.
    fn within(path: &Path, target: &Path, linked: bool) -> Result<Self, WriteError> {
        let target = std::path::absolute(target).map_err(|source| failed(path, source))?;
        let (Some(folder), Some(name)) = (target.parent(), target.file_name()) else {
            return match fs::metadata(&target) {
                // Root folder.
                Ok(about) if about.is_dir() => Ok(Self {
                    lock: locked(path, &target, std::ffi::OsStr::new("."))?,
                    path: target,
                    _made: Made::default(),
                }),
                _ => Err(blocked(path, "it is no name")),
            };
        };
        if linked && !folder.is_dir() {
            return Err(blocked(
                path,
                "it is a symbolic link into a folder that does not exist",
            ));
        }
        let made = Made::make(path, folder)?;
        let folder = fs::canonicalize(folder).map_err(|source| failed(path, source))?;
        Ok(Self {
            lock: locked(path, &folder, name)?,
            path: folder.join(name),
            _made: made,
        })
    }

    /// Folder that contains the output.
    pub(super) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(&self.path)
    }
}

const NO_FOLDER: &str = "expected a folder, but it or a part of its path is a file";

fn failed(path: &Path, source: io::Error) -> WriteError {
    WriteError::Io {
        path: path.to_owned(),
        needed_bytes: 0,
        source,
    }
}

fn blocked(path: &Path, what: &'static str) -> WriteError {
    WriteError::Blocked {
        path: path.to_owned(),
        what,
    }
}

fn locked(path: &Path, folder: &Path, name: &std::ffi::OsStr) -> Result<Arc<Lock>, WriteError> {
    Lock::take(folder, name).map_err(|error| match error {
        LockError::Busy(holder) => WriteError::Locked {
            path: path.to_owned(),
            holder,
        },
        LockError::Io(source) => failed(path, source),
    })
}

/// Target of `path`, which need not exist, and whether `path` is a symbolic link.
fn followed(path: &Path) -> io::Result<(PathBuf, bool)> {
    let mut target = path.to_owned();
    for count in 0..MAX_LINKS {
        match fs::symlink_metadata(&target) {
            Ok(about) if about.is_symlink() => {
                let to = fs::read_link(&target)?;
                target = match target.parent() {
                    Some(folder) => folder.join(to),
                    None => to,
                };
            }
            _ => return Ok((target, count > 0)),
        }
    }
    Err(io::Error::other(format!(
        "more than {MAX_LINKS} symbolic links in a chain"
    )))
}

/// Folders created for an output, innermost first. Empty ones are removed when dropped.
#[derive(Debug, Default)]
struct Made(Vec<PathBuf>);

impl Made {
    /// Create `folder` and its parents for the output for which the user gave `path`.
    fn make(path: &Path, folder: &Path) -> Result<Self, WriteError> {
        let mut missing = Vec::new();
        for above in folder.ancestors() {
            match fs::metadata(above) {
                Ok(about) if about.is_dir() => break,
                Ok(_) => return Err(blocked(path, NO_FOLDER)),
                Err(error)
                    if matches!(
                        error.kind(),
                        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
                    ) =>
                {
                    missing.push(above.to_owned());
                }
                Err(source) => return Err(failed(path, source)),
            }
        }
        // Outermost first, so that they are removed in reverse order.
        for folder in missing.iter().rev() {
            unfinished::begin(Unfinished::EmptyFolder(folder.clone()));
        }
        let made = Self(missing);
        // On failure this is dropped, which removes the folders created so far.
        fs::create_dir_all(folder).map_err(|source| failed(path, source))?;
        Ok(made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        for folder in &self.0 {
            // Fails for a folder that is not empty, as intended.
            let _ = fs::remove_dir(folder);
            unfinished::end(folder);
        }
    }
}
