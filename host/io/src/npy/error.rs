//! Errors of NPY files.

use std::io;
use std::path::PathBuf;

/// Why an array was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The operating system reported an error.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path of the file that failed.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// Not a complex64 image.
    #[error("{path}: {what}")]
    Unsuited {
        /// Path of the file that failed.
        path: PathBuf,
        /// What it is, and what was expected.
        what: String,
    },
}
