//! A file written beside its place and then renamed into it: complete, or not at all.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

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
        let file = builder.tempfile_in(folder_of(&target))?;
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
