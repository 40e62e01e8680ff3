//! A file written beside its place and then renamed into it: complete, or not at all.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Why nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system refused.
    #[error("cannot write {}: {source}{}", path.display(), advice(source, *needed_bytes))]
    Io {
        /// What was to be written.
        path: PathBuf,
        /// Size of it all, 0 if not known.
        needed_bytes: u64,
        /// Cause.
        source: io::Error,
    },
    /// The disk is too full to begin.
    #[error(
        "cannot write {}: {needed_bytes} bytes are needed and {free_bytes} are free there; free some \
         or write elsewhere",
        path.display()
    )]
    NoSpace {
        /// What was to be written.
        path: PathBuf,
        /// Size of it.
        needed_bytes: u64,
        /// Bytes free.
        free_bytes: u64,
    },
    /// Something is in the way.
    #[error("cannot write {}: {what}", path.display())]
    Blocked {
        /// What was to be written.
        path: PathBuf,
        /// What is in the way.
        what: &'static str,
    },
}

fn advice(source: &io::Error, needed_bytes: u64) -> String {
    let full = matches!(
        source.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    );
    let closed = matches!(
        source.kind(),
        io::ErrorKind::PermissionDenied
            | io::ErrorKind::ReadOnlyFilesystem
            | io::ErrorKind::NotFound
    );
    match (full, needed_bytes) {
        (false, _) if closed => "; choose a folder that exists and can be written to".to_owned(),
        (false, _) => String::new(),
        (true, 0) => "; free some space or write elsewhere".to_owned(),
        (true, bytes) => format!("; {bytes} bytes are needed: free some or write elsewhere"),
    }
}

/// Writes one file, complete or not at all: `write` fills a file beside it, which is forced to disk
/// and then renamed to `path`. `needed_bytes` is for the message of a full disk; 0 if not known.
/// A symbolic link is followed.
///
/// # Errors
/// [`WriteError`]; then `path` is as it was and nothing is left beside it.
pub fn write_atomically<T>(
    path: &Path,
    needed_bytes: u64,
    write: impl FnOnce(&mut File) -> io::Result<T>,
) -> Result<T, WriteError> {
    let failed = |source| WriteError::Io {
        path: path.to_owned(),
        needed_bytes,
        source,
    };
    let mut beside = Beside::create(path).map_err(failed)?;
    let value = write(beside.file()).map_err(failed)?;
    beside.commit().map_err(failed)?;
    Ok(value)
}

/// A hidden file in the folder of its target. Gone when dropped, unless committed.
pub(super) struct Beside {
    file: tempfile::NamedTempFile,
    target: PathBuf,
}

impl Beside {
    /// Begins a file that is to become `path`. A symbolic link is followed.
    ///
    /// # Errors
    /// If the folder cannot be written to, or `path` exists and is not a file.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let target = match fs::metadata(path) {
            Ok(metadata) if metadata.is_file() => fs::canonicalize(path)?,
            Ok(_) => return Err(io::Error::other("it exists and is not a file")),
            Err(_) => path.to_owned(),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".subap-").suffix(".part");
        // Files are private by that crate's default; these should be like any other, less the umask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder_of(&target)).map_err(plain)?;
        Ok(Self { file, target })
    }

    /// The file to be filled.
    pub(super) fn file(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// Forces the file to disk and renames it into place.
    ///
    /// # Errors
    /// Then the target is as it was.
    pub(super) fn commit(self) -> io::Result<()> {
        self.file.as_file().sync_all()?;
        self.file.persist(&self.target)?;
        sync_folder(folder_of(&self.target))
    }
}

/// The error without the name of the hidden file, which says nothing to the user.
pub(super) fn plain(error: io::Error) -> io::Error {
    io::Error::from(error.kind())
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Forces a folder's names to disk, where the system can.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}
