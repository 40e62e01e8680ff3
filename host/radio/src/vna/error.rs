//! Errors of a capture.

use std::io;
use std::path::PathBuf;

use subaperture_io::atomic::WriteError;

use super::fault::Fault;

/// Error that ends a capture. Sweeps recorded before remain.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VnaError {
    /// The analyser does not have the requested settings.
    #[error("network analyser: {0}")]
    Refused(String),
    /// A sweep failed after all retries.
    #[error("sweep {sweep} failed {attempts} times, last by this fault: {fault}")]
    Sweep {
        /// Number of the sweep, from 0.
        sweep: u64,
        /// Number of attempts at this sweep.
        attempts: u32,
        /// Fault of the last attempt.
        fault: Fault,
    },
    /// The folder cannot take the capture.
    #[error("{0}")]
    Folder(String),
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
