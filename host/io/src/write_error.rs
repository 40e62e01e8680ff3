//! Errors of writing outputs.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

/// Reason why an output was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system reported an error.
    #[error("cannot write {}: {source}{}", path.display(), advice(source, *needed_bytes))]
    Io {
        /// Path of the output.
        path: PathBuf,
        /// Size of the output in bytes; 0 if unknown.
        needed_bytes: u64,
        /// Error of the system.
        source: io::Error,
    },
    /// The disk has too little free space.
    #[error(
        "cannot write {}: {needed_bytes} bytes are needed, but {free_bytes} are free there; free some \
         or write elsewhere",
        path.display()
    )]
    NoSpace {
        /// Path of the output.
        path: PathBuf,
        /// Size of the output in bytes.
        needed_bytes: u64,
        /// Free space in bytes.
        free_bytes: u64,
    },
    /// The path is not available.
    #[error("cannot write {}: {what}", path.display())]
    Blocked {
        /// Path of the output.
        path: PathBuf,
        /// Obstacle.
        what: &'static str,
    },
    /// Another run is writing the output.
    #[error(
        "cannot write {}: another run ({holder}) is writing it; wait for it to end, or write elsewhere",
        path.display()
    )]
    Locked {
        /// Path of the output.
        path: PathBuf,
        /// Description of the process that holds the lock.
        holder: String,
    },
    /// The output is an input of the same run.
    #[error("cannot write {}: {}; name another file", path.display(), same(path, input))]
    IsInput {
        /// Path of the output.
        path: PathBuf,
        /// Path of the input.
        input: PathBuf,
    },
    /// The same path was given for two outputs.
    #[error("cannot write {}: the same path was given for two outputs", path.display())]
    Twice {
        /// Path of the output.
        path: PathBuf,
    },
    /// Only some files of a set were replaced, and undoing the renames failed as well.
    #[error("{error}; {}", left_in_part(replaced, kept))]
    InPart {
        /// First error.
        error: Box<WriteError>,
        /// Files that are new, or absent.
        replaced: Vec<PathBuf>,
        /// Paths of their old content.
        kept: Vec<PathBuf>,
    },
    /// The path exists and was not written by this program.
    #[error(
        "cannot write {}: it exists, and {what}",
        path.display()
    )]
    NotOurs {
        /// Path of the output.
        path: PathBuf,
        /// Reason why it does not count as written by this program.
        what: &'static str,
    },
}

fn same(path: &Path, input: &Path) -> String {
    match path == input {
        true => "it is an input of this run".to_owned(),
        false => format!(
            "it is the same file as {}, an input of this run",
            input.display()
        ),
    }
}

fn left_in_part(replaced: &[PathBuf], kept: &[PathBuf]) -> String {
    let list = |paths: &[PathBuf]| {
        let paths = paths.iter().map(|path| path.display().to_string());
        paths.collect::<Vec<_>>().join(", ")
    };
    let replaced = list(replaced);
    let mut text = format!(
        "restoring the older files failed as well; outputs are incomplete: {replaced} are of this run, or absent"
    );
    if !kept.is_empty() {
        let kept = list(kept);
        text += &format!(
            "; the older content is in {kept}: rename it, since the next run that writes there removes it"
        );
    }
    text
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
        (false, _) if is_fault(source) => {
            "; the disk reports a fault: check it, or write to another".to_owned()
        }
        (false, _) if closed => "; choose a folder that exists and can be written to".to_owned(),
        (false, _) => String::new(),
        (true, 0) => "; free some space or write elsewhere".to_owned(),
        (true, bytes) => format!("; {bytes} bytes are needed: free some or write elsewhere"),
    }
}

/// Whether the system reports a fault of the device (`EIO`), also inside another error.
fn is_fault(source: &io::Error) -> bool {
    const EIO: i32 = 5;
    let mut cause: Option<&(dyn Error + 'static)> = Some(source);
    while let Some(error) = cause {
        let system = error.downcast_ref::<io::Error>();
        if let Some(code) = system.and_then(io::Error::raw_os_error) {
            return cfg!(unix) && code == EIO;
        }
        cause = error.source();
    }
    false
}
