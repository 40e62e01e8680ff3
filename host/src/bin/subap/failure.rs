//! How a command fails: what is printed, and the exit status.

use std::io::ErrorKind;
use std::process::ExitCode;

use subaperture::focus::FormError;
use subaperture::io::{cphd, recording};
use subaperture::link::LinkError;

/// What was typed does not make sense together. Exit status 2, as clap's own.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

/// Everything was done and written, and misses the error bound as `--allow-error` allows. Exit status 3.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BoundMissed(pub(crate) String);

/// Work stopped by the user.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// [`Interrupted`], after some of a command's files were written.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; every file in {0} is whole, but some are missing or of an earlier run")]
pub(crate) struct InterruptedAmidFiles(pub(crate) String);

/// [`Interrupted`], with the maps received so far in their file.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the {maps} maps received so far are in {path}")]
pub(crate) struct InterruptedWithMaps {
    pub(crate) maps: u64,
    pub(crate) path: String,
}

/// Prints `error` on standard error, causes after it, and says how to exit.
pub(crate) fn report(error: &anyhow::Error) -> ExitCode {
    if error.chain().any(is_broken_pipe) {
        // The reader of our output has seen enough.
        return ExitCode::SUCCESS;
    }
    if let Some(interruption) = error.downcast_ref::<InterruptedAmidFiles>() {
        eprintln!("subap: {interruption}");
        return ExitCode::from(130);
    }
    if let Some(interruption) = error.downcast_ref::<InterruptedWithMaps>() {
        eprintln!("subap: {interruption}");
        return ExitCode::from(130);
    }
    if error.chain().any(is_interruption) {
        eprintln!("subap: interrupted; nothing was left in part");
        return ExitCode::from(130);
    }
    eprintln!("subap: {}", one_line(error));
    ExitCode::from(match () {
        () if error.is::<Usage>() => 2,
        () if error.is::<BoundMissed>() => 3,
        () => 1,
    })
}

/// The error and its causes; a cause that its parent already tells is not repeated.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if line.is_empty() {
            line = text;
        } else if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
    }
    line
}

fn is_interruption(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause.is::<Interrupted>()
        || matches!(cause.downcast_ref(), Some(FormError::Cancelled))
        || matches!(cause.downcast_ref(), Some(LinkError::Cancelled))
        || matches!(cause.downcast_ref(), Some(cphd::WriteError::Cancelled))
        || matches!(cause.downcast_ref(), Some(recording::WriteError::Cancelled))
}

/// Only of standard output: see [`crate::text::say`].
fn is_broken_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn causes_are_told_once() {
        let inner = anyhow::anyhow!("no space left");
        let error = inner.context("cannot write a.npy: no space left");
        assert_eq!(one_line(&error), "cannot write a.npy: no space left");
        let error: anyhow::Error = Err::<(), _>(anyhow::anyhow!("no space left"))
            .context("cannot write a.npy")
            .unwrap_err();
        assert_eq!(one_line(&error), "cannot write a.npy: no space left");
    }

    #[test]
    fn cancelled_work_is_an_interruption() {
        let error = anyhow::Error::new(FormError::Cancelled).context("focusing");
        assert!(error.chain().any(is_interruption));
    }
}
