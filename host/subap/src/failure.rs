//! Failures of a command: printed text and exit status.

use subaperture::describe::DescriptionError;
use subaperture::focus::FormError;
use subaperture::io::{cphd, recording};
use subaperture::maps::MapError;
use subaperture::module::link::LinkError;
use subaperture::targets::TargetsError;

use crate::advice::{self, one_line};
use crate::arguments::arguments;
use crate::messages;
use crate::text::{self, SayError};

/// Exit statuses, as documented in README and `--help`.
pub(crate) const DONE: u8 = 0;
pub(crate) const FAILED: u8 = 1;
pub(crate) const WRONG_USAGE: u8 = 2;
pub(crate) const BOUND_MISSED: u8 = 3;
pub(crate) const INTERRUPTED: u8 = 130;

/// Wrong usage: invalid combination of options. Exit status 2, as for clap's own errors.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

impl Usage {
    /// Refuse the first given option that does not apply to a `device`; `instead` is the advice.
    pub(crate) fn refuse(
        options: &[(&str, bool)],
        device: &str,
        instead: &str,
    ) -> Result<(), Self> {
        match options.iter().find(|(_, given)| *given) {
            None => Ok(()),
            Some((option, _)) => Err(Self(format!(
                "{option} does not apply to {device}: leave it out; {instead}"
            ))),
        }
    }
}

/// Work stopped by the user.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// [`Interrupted`], with the finished stages of a job and the tiles of the unfinished one kept.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; finished work is kept in {0}, and the same command continues from there")]
pub(crate) struct InterruptedJob(pub(crate) String);

/// [`Interrupted`], with the products received so far kept: "3 maps are in a.maps".
#[derive(Debug, thiserror::Error)]
#[error("interrupted; {0}")]
pub(crate) struct InterruptedLink(pub(crate) String);

/// [`Interrupted`], with the steps or sweeps captured so far kept in their recording.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the {steps} {unit} captured so far are in {path}, a complete recording")]
pub(crate) struct InterruptedWithSteps {
    pub(crate) steps: u64,
    pub(crate) unit: &'static str,
    pub(crate) path: String,
}

/// Whether `--json` is among the arguments of this process; used when the arguments do not parse.
pub(crate) fn json_is_asked_for() -> bool {
    let mut words = arguments().iter().take_while(|word| *word != "--");
    words.any(|word| word == "--json")
}

/// Print wrong usage as a JSON object on standard output. `where` is the option.
pub(crate) fn say_wrong_usage(error: &clap::Error) {
    use clap::error::{ContextKind, ContextValue};
    let place = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(option)) => Some(option.clone()),
        Some(ContextValue::Strings(options)) => Some(options.join(", ")),
        _ => None,
    };
    let text = error.to_string();
    let text = text.split("\n\nUsage:").next().unwrap_or_default();
    let text = text.strip_prefix("error: ").unwrap_or(text).trim_end();
    say_error(text, place, None, WRONG_USAGE);
}

/// Print an error as a JSON object on standard output.
fn say_error(text: &str, place: Option<String>, advice: Option<String>, exit_status: u8) {
    let object = serde_json::json!({
        "error": text,
        "where": place,
        "advice": advice,
        "exit_status": exit_status,
    });
    // A write error on standard output does not change the exit status.
    let _ = text::say_json("error", object);
}

/// Print why a command failed, with its causes, and return the exit status. With `json`, an error is printed as a JSON
/// object on standard output too, unless the command has printed a result there.
pub(crate) fn exit_status(done: anyhow::Result<()>, json: bool) -> u8 {
    let json = json && !messages::has_result();
    let (place, advice) = match &done {
        Err(error) if json => (place(error), advice::alone(error)),
        _ => (None, None),
    };
    let (exit_status, text) = reported(done);
    if let Some(text) = text.filter(|_| json) {
        say_error(&text, place, advice, exit_status);
    }
    exit_status
}

/// File, line and key of the first fault, if the error is about a text file.
fn place(error: &anyhow::Error) -> Option<String> {
    let mut causes = error.chain();
    let found = causes.find_map(|cause| cause.downcast_ref::<DescriptionError>())?;
    found.faults.first().map(|fault| fault.place.to_string())
}

/// Print why a command failed on standard error. Returns the exit status and the text of the error.
fn reported(done: anyhow::Result<()>) -> (u8, Option<String>) {
    let error = match done {
        Ok(()) if messages::bound_is_missed() => return (BOUND_MISSED, None),
        Ok(()) => return (DONE, None),
        Err(error) => error,
    };
    if let Some(SayError::ReaderGone) = error.downcast_ref() {
        return (DONE, None);
    }
    if error.is::<InterruptedJob>()
        || error.is::<InterruptedLink>()
        || error.is::<InterruptedWithSteps>()
    {
        let text = error.to_string();
        messages::error(&text);
        return (INTERRUPTED, Some(text));
    }
    if error.chain().any(is_interruption) {
        let text = "interrupted; no partial output was left";
        messages::error(text);
        return (INTERRUPTED, Some(text.to_owned()));
    }
    let text = one_line(&error);
    messages::error(&text);
    let exit_status = if error.is::<Usage>() {
        WRONG_USAGE
    } else {
        FAILED
    };
    (exit_status, Some(text))
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
    fn causes_are_printed_once() {
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
