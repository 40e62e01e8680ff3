//! How a command ends: what is printed, and the exit status.

use subaperture::focus::FormError;
use subaperture::io::{cphd, recording};
use subaperture::maps::MapError;
use subaperture::onboard::link::LinkError;
use subaperture::targets::TargetsError;

use crate::advice::one_line;
use crate::messages;
use crate::text::SayError;

/// Exit statuses, as README and `--help` have them.
pub(crate) const DONE: u8 = 0;
pub(crate) const FAILED: u8 = 1;
pub(crate) const WRONG_USAGE: u8 = 2;
pub(crate) const BOUND_MISSED: u8 = 3;
pub(crate) const INTERRUPTED: u8 = 130;

/// What was typed does not make sense together. Exit status 2, as clap's own.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

/// Work stopped by the user.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// [`Interrupted`], after some of a command's files were written.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; every file in {0} is whole, but some are missing or of an earlier run")]
pub(crate) struct InterruptedAmidFiles(pub(crate) String);

/// [`Interrupted`], with all stages of a job that were done, and the tiles of the one that was not.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; what was done is in {0}, and the same command goes on from there")]
pub(crate) struct InterruptedJob(pub(crate) String);

/// [`Interrupted`], with the maps received so far in their file.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the {maps} maps received so far are in {path}")]
pub(crate) struct InterruptedWithMaps {
    pub(crate) maps: u64,
    pub(crate) path: String,
}

/// [`Interrupted`], with all that was captured so far in its recording.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the {steps} steps captured so far are in {path}, which is whole")]
pub(crate) struct InterruptedWithSteps {
    pub(crate) steps: u64,
    pub(crate) path: String,
}

/// Prints why a command failed, if it did, causes after it; the exit status.
pub(crate) fn exit_status(done: anyhow::Result<()>) -> u8 {
    let error = match done {
        Ok(()) if messages::bound_is_missed() => return BOUND_MISSED,
        Ok(()) => return DONE,
        Err(error) => error,
    };
    if let Some(SayError::ReaderGone) = error.downcast_ref() {
        return DONE;
    }
    if error.is::<InterruptedAmidFiles>()
        || error.is::<InterruptedJob>()
        || error.is::<InterruptedWithMaps>()
        || error.is::<InterruptedWithSteps>()
    {
        messages::error(&error.to_string());
        return INTERRUPTED;
    }
    if error.chain().any(is_interruption) {
        messages::error("interrupted; nothing was left in part");
        return INTERRUPTED;
    }
    messages::error(&one_line(&error));
    if error.is::<Usage>() {
        WRONG_USAGE
    } else {
        FAILED
    }
}

fn is_interruption(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause.is::<Interrupted>()
        || matches!(cause.downcast_ref(), Some(FormError::Cancelled))
        || matches!(cause.downcast_ref(), Some(LinkError::Cancelled))
        || matches!(cause.downcast_ref(), Some(TargetsError::Cancelled))
        || matches!(cause.downcast_ref(), Some(MapError::Cancelled))
        || matches!(cause.downcast_ref(), Some(cphd::WriteError::Cancelled))
        || matches!(cause.downcast_ref(), Some(recording::WriteError::Cancelled))
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
