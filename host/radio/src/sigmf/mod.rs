//! Recordings as SigMF 1.2: `NAME.sigmf-data`, counts `ci16_le` of both channels side by side (reference I, Q, echo I, Q, ...), and
//! `NAME.sigmf-meta`, JSON with a capture segment and an annotation for each step.
//!
//! ```text
//! Writer ── data appended, then a line of NAME.sigmf-journal ── finish ──> meta with all steps, journal gone
//! killed ──> data, journal, and the meta of the beginning, which knows no steps: Recording::open takes them of the journal
//! ```
//!
//! A journal, and not a meta that is rewritten now and then: rewriting costs as much as there are steps, each time, and loses those
//! since the last; a line a step costs the same for every step and loses none whose line is whole. The first meta is valid SigMF by
//! itself, so other readers open a killed capture too, without its steps. A step's line is written after its samples, so lines never
//! tell of samples that are not there; a torn last line is left out. That holds for a process that is killed; for a machine that
//! loses its power, data are forced to disk at the end only, and lines beyond the data's end are left out.
//!
//! Our own keys bear `subaperture:`; annotations without them are others', and skipped; one with such a key that is no step is an error. Memory: of a writer one line; of a reader 200 bytes a
//! step. The files of a recording are never written over.

mod metadata;
mod read;
mod write;

pub use metadata::{Flag, Setup, Step};
pub use read::Recording;
pub use write::Writer;

use std::path::{Path, PathBuf};

/// What is wrong with a recording, or with writing it.
#[derive(Debug, thiserror::Error)]
pub enum SigmfError {
    /// The system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Not what is read here.
    #[error("{path}: {what}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what is wanted.
        what: String,
    },
    /// Something stands there.
    #[error("{0} is there already, and recordings are not written over: choose another name")]
    Exists(PathBuf),
    /// The metadata could not be put in place.
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

/// Ends of names.
const DATA: &str = "sigmf-data";
const META: &str = "sigmf-meta";
const JOURNAL: &str = "sigmf-journal";

/// The file of a recording with this ending; `path` is the recording's name, with any of the endings or none.
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
