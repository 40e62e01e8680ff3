//! Outcome of a transfer: its report, and the closing record of the file of maps.

use std::time::Duration;

use anyhow::bail;
use serde_json::json;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::link::{Job, LinkError, Outcome, TransferEnd};
use subaperture::module::maps::RunTotals;

use crate::args::Link;
use crate::config::{Session, record_of_run};
use crate::failure::InterruptedWithMaps;
use crate::{advice, text};

/// Report the outcome. It is an error unless all maps were received.
pub(super) fn report(
    session: &Session,
    typed: &Link,
    outcome: &Outcome,
    compared: Option<(u64, u64)>,
    maps: u64,
    taken: Duration,
) -> anyhow::Result<()> {
    let path = typed.out.display().to_string();
    if session.json() {
        let mut report = json!({
            "maps": maps,
            "ending": ending_name(&outcome.ending, maps < outcome.counts.maps_wanted),
            "counters": outcome.counts.to_json(),
            "run": record_of_run(session, taken),
        });
        if let Some((same, different)) = compared {
            report["verified"] = json!({ "same": same, "different": different });
        }
        let mut files = Vec::new();
        if maps > 0 {
            files.push(WrittenFile::new(&typed.out, FileKind::Maps));
        }
        let picture = typed.picture.iter().filter(|path| path.exists());
        files.extend(picture.map(|path| WrittenFile::new(path, FileKind::Picture)));
        report["files"] = json!(files);
        text::say_json("link", report)?;
    } else if session.prints_text() && maps > 0 {
        text::say(format!("{path}: {maps} maps in {}", text::duration(taken)))?;
        text::say(outcome.counts.to_string())?;
    }
    if let Some((same, different)) = compared
        && maps > 0
        && !session.json()
    {
        text::say(format!(
            "verified  {same} maps bit-identical to the core on this computer, {different} not"
        ))?;
    }
    if let Some((_, different)) = compared
        && different > 0
    {
        bail!(
            "{different} maps differ from those of the core on this computer and were left out: is the firmware of this \
             version?"
        );
    }
    match &outcome.ending {
        TransferEnd::Complete => Ok(()),
        // An error status, so that scripts do not use an incomplete aperture unnoticed.
        TransferEnd::Incomplete => bail!(
            "{} of {} maps are missing: {}; {}",
            outcome.missing.len(),
            outcome.counts.maps_wanted,
            match typed.rate {
                Some(_) => "module or line are too slow for this --rate",
                None => "the line loses too many frames: raise --retries",
            },
            match maps {
                0 => "nothing was written".to_owned(),
                _ => format!("the {maps} maps received are in {path}"),
            }
        ),
        TransferEnd::Failed(LinkError::Cancelled) if maps > 0 => {
            Err(InterruptedWithMaps { maps, path }.into())
        }
        TransferEnd::Failed(error) if maps > 0 && !matches!(error, LinkError::Cancelled) => {
            bail!(
                "{}; the {maps} maps received so far are in {path}",
                advice::with_advice(error)
            )
        }
        failed @ TransferEnd::Failed(_) => refuse_failure(failed),
    }
}

/// Report a failed transfer without results.
pub(super) fn refuse_failure(ending: &TransferEnd) -> anyhow::Result<()> {
    match ending {
        TransferEnd::Failed(LinkError::Cancelled) => Err(LinkError::Cancelled.into()),
        TransferEnd::Failed(error) => bail!("{}", advice::with_advice(error)),
        TransferEnd::Complete | TransferEnd::Incomplete => Ok(()),
    }
}

/// Closing record of the file.
pub(super) fn closing(
    outcome: &Outcome,
    job: &Job<'_>,
    compared: Option<(u64, u64)>,
    written: u64,
) -> RunTotals {
    /// Maximum number of missing maps listed individually.
    const NAMED: usize = 1000;
    // Received maps that failed verification count as missing too.
    let missing = outcome.counts.maps_wanted.saturating_sub(written);
    let mut counters = outcome.counts.to_json();
    let named = outcome.missing.iter().take(NAMED);
    counters.insert(
        "missing".to_owned(),
        named
            .map(|(sub_cpi, patch)| json!([sub_cpi, patch]))
            .collect(),
    );
    counters.insert("maps_missing".to_owned(), json!(missing));
    counters.insert(
        "ending".to_owned(),
        json!(ending_name(
            &outcome.ending,
            written < outcome.counts.maps_wanted
        )),
    );
    if let Some((same, different)) = compared {
        counters.insert(
            "verified".to_owned(),
            json!({ "same": same, "different": different }),
        );
    }
    RunTotals {
        num_pulses: job.pulses.len().into(),
        weight_sum: job.pulses.weight_sum(),
        counters,
    }
}

/// Ending of a transfer in one word, or its failure.
pub(super) fn ending_name(ending: &TransferEnd, some_are_missing: bool) -> String {
    match ending {
        TransferEnd::Complete if !some_are_missing => "complete".to_owned(),
        TransferEnd::Complete | TransferEnd::Incomplete => "incomplete".to_owned(),
        TransferEnd::Failed(error) => error.to_string(),
    }
}
