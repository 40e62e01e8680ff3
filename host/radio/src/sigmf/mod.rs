//! Recordings in SigMF 1.2: `NAME.sigmf-data` with interleaved `ci16_le` samples of both channels (reference I, Q, echo
//! I, Q, ...), and `NAME.sigmf-meta`, JSON with a capture segment and an annotation per step.
//!
//! ```text
//! Writer ── append data, then a line to NAME.sigmf-journal ── finish ──> meta with all steps, journal removed
//! killed ──> data, journal, and the initial meta without steps: Recording::open reads the steps from the journal
//! ```
//!
//! The journal replaces periodic rewriting of the metadata. Rewriting costs time in proportion to the number of steps
//! and loses the steps since the last time. A journal line costs the same for every step, and no complete line is lost.
//! The initial metadata file is valid SigMF, so that other readers can open a killed capture too, without its steps. A
//! step's line is written after its samples, so that no line refers to missing samples; an incomplete last line is
//! ignored. This holds when the process is killed. After a power failure, lines beyond the end of the data are ignored,
//! since data are synced to disk only at the end.
//!
//! Keys of this project begin with `subaperture:`. Annotations without such keys are skipped; an annotation that has
//! one but is not a valid step is an error. Memory: one line in the writer, 200 bytes per step in the reader. Existing
//! files are never overwritten.

mod metadata;
mod read;
mod write;

pub use metadata::{Flag, Setup, Step};
pub use read::Recording;
pub use write::Writer;
pub(crate) use write::discard;

use std::path::{Path, PathBuf};

/// Error of reading or writing a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SigmfError {
    /// The file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a recording of this format.
    #[error("{path}: {what}")]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Fault and expected content.
        what: String,
    },
    /// The steps exceed the memory limit.
    #[error(
        "{}: only the first {steps} steps fit the memory limit of {allowed_bytes} bytes: allow more memory",
        path.display()
    )]
    Memory {
        /// Path of the file.
        path: PathBuf,
        /// Number of steps that fit.
        steps: usize,
        /// Memory limit, bytes.
        allowed_bytes: u64,
    },
    /// A file of this name exists.
    #[error("{0} exists, and recordings are never overwritten: choose another name")]
    Exists(PathBuf),
    /// The metadata file could not be written.
    #[error(transparent)]
    Write(#[from] subaperture_io::atomic::WriteError),
}

impl SigmfError {
    fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    fn format(path: &Path, what: impl Into<String>) -> Self {
        Self::Format {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}

/// File name suffixes.
const DATA: &str = "sigmf-data";
const META: &str = "sigmf-meta";
const JOURNAL: &str = "sigmf-journal";

/// Path of a recording's file with this suffix; `path` is the recording's name, with or without a suffix.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let known = path
        .extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| [DATA, META, JOURNAL].contains(&e));
    let mut name = match known {
        true => path.with_extension("").into_os_string(),
        false => path.as_os_str().to_owned(),
    };
    name.push(".");
    name.push(ending);
    PathBuf::from(name)
}
