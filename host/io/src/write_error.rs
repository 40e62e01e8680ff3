//! Why an output was not written.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

/// Why nothing was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system reported an error.
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
    /// Another run is writing it.
    #[error(
        "cannot write {}: another run ({holder}) is writing it; wait for it to end, or write elsewhere",
        path.display()
    )]
    Locked {
        /// What was to be written.
        path: PathBuf,
        /// Who holds the lock.
        holder: String,
    },
    /// It is read by the same run.
    #[error("cannot write {}: {}; name another file", path.display(), same(path, input))]
    IsInput {
        /// What was to be written.
        path: PathBuf,
        /// The input, by its own name.
        input: PathBuf,
    },
    /// It is named twice.
    #[error("cannot write {}: it is named twice, for two outputs", path.display())]
    Twice {
        /// What was to be written.
        path: PathBuf,
    },
    /// Files that belong together are neither all new nor as they were: putting them back failed too.
    #[error("{error}; {}", left_in_part(replaced, kept))]
    InPart {
        /// The error that came first.
        error: Box<WriteError>,
        /// Files that are new, or absent.
        replaced: Vec<PathBuf>,
        /// Where their old content is.
        kept: Vec<PathBuf>,
    },
    /// Something stands there that this program did not write.
    #[error(
        "cannot write {}: it is there already, and {what}",
        path.display()
    )]
    NotOurs {
        /// What was to be written.
        path: PathBuf,
        /// How that shows.
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
        "putting back the older files failed too, and outputs are left in part: {replaced} are of this run, or absent"
    );
    if !kept.is_empty() {
        let kept = list(kept);
        text += &format!(
            "; the older content is in {kept}: rename it, for the next run that writes there removes it"
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
