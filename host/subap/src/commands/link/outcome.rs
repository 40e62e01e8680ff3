//! Outcome of a transfer: its report for all products, and the closing record of the file of maps.

use std::time::Instant;

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::io::written::WrittenFile;
use subaperture::module::link::{Job, LinkError, Outcome, TransferEnd};
use subaperture::module::maps::RunTotals;

use crate::args::{Link, Sent};
use crate::config::{Session, record_of_run};
use crate::failure::InterruptedLink;
use crate::{advice, text};

/// Received products, for the report.
pub(super) struct Received {
    /// Content of the output, such as "3 maps". `None` without an output.
    pub(super) content: Option<String>,
    /// Counts in the JSON report, with their names.
    pub(super) numbers: Vec<(&'static str, u64)>,
    /// Numbers of maps or pixels that equal those of the core on this computer, and that differ from them.
    pub(super) compared: Option<(u64, u64)>,
    pub(super) files: Vec<WrittenFile>,
}

/// Report the outcome. It is an error unless everything was received, so that scripts do not use an incomplete
/// aperture unnoticed.
pub(super) fn report(
    session: &Session,
    typed: &Link,
    outcome: &Outcome,
    received: &Received,
    start: Instant,
) -> anyhow::Result<()> {
    let Outcome {
        counts,
        missing,
        ending,
    } = outcome;
    let path = typed.out.display();
    let ratio = counts.down_up_ratio();
    let (taken, compared) = (start.elapsed(), received.compared);
    if session.json() {
        let mut report = json!({
            "ending": ending_name(outcome, compared),
            "counters": counts.to_json(),
            "down_up_ratio": ratio,
            "verified": verified_record(compared),
            "run": record_of_run(session, taken),
            "files": received.files,
        });
        for (name, number) in &received.numbers {
            report[name] = json!(number);
        }
        text::say_json("link", report)?;
    } else if let Some(content) = &received.content {
        if session.prints_text() {
            let taken = text::duration(taken);
            text::say(format!(
                "{path}: {content} in {taken}\n{counts}\n\
                 ratio     {ratio:.4} bytes from the module for each byte to it"
            ))?;
        }
        if let Some((same, different)) = compared {
            let unit = match typed.send {
                Sent::Image => "pixels",
                _ => "maps",
            };
            text::say(format!(
                "verified  {same} {unit} bit-identical to the core on this computer, {different} not"
            ))?;
        }
    }
    if let Some((_, different @ 1..)) = compared {
        bail!(
            "{different} maps differ from those of the core on this computer and were left out: is the firmware of this \
             version?"
        );
    }
    let kept = received.content.as_ref();
    let kept = kept.map(|content| format!("{content} are in {path}"));
    let files = kept.as_deref().unwrap_or("no file was written");
    match ending {
        TransferEnd::Complete => Ok(()),
        TransferEnd::Incomplete => bail!(
            "{}: {}; {files}",
            match missing.len() {
                0 => "parts of the image are missing".to_owned(),
                count => format!("{count} of {} maps are missing", counts.maps_wanted),
            },
            match typed.rate {
                Some(_) => "module or line are too slow for this --rate",
                None if typed.front_end =>
                    "the front end of the module lost pulses or ended before the last one",
                None => "the line loses too many frames: raise --retries",
            }
        ),
        TransferEnd::Failed(LinkError::Cancelled) => Err(match kept {
            Some(kept) => InterruptedLink(kept).into(),
            None => LinkError::Cancelled.into(),
        }),
        TransferEnd::Failed(error) => {
            bail!("{}; {files}", advice::with_advice(error))
        }
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
    let ending = ending_name(outcome, compared);
    counters.insert("ending".to_owned(), json!(ending));
    if compared.is_some() {
        counters.insert("verified".to_owned(), verified_record(compared));
    }
    RunTotals {
        num_pulses: job.pulses.len().into(),
        weight_sum: job.pulses.weight_sum(),
        counters,
    }
}

/// Numbers of equal and different maps or pixels, as in JSON.
pub(super) fn verified_record(compared: Option<(u64, u64)>) -> Value {
    json!(compared.map(|(same, different)| json!({ "same": same, "different": different })))
}

/// Ending of a transfer in one word, or its failure. Maps that differ from those of the core count as missing.
fn ending_name(outcome: &Outcome, compared: Option<(u64, u64)>) -> String {
    match &outcome.ending {
        TransferEnd::Complete if compared.is_none_or(|(_, different)| different == 0) => {
            "complete".to_owned()
        }
        TransferEnd::Complete | TransferEnd::Incomplete => "incomplete".to_owned(),
        TransferEnd::Failed(error) => error.to_string(),
    }
}
