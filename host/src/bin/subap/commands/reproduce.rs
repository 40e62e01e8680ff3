//! `subap reproduce`: the figures of both theses, made again.

use std::time::Instant;

use anyhow::bail;
use subaperture::reproduce::{Context, Item, Step, items, names, run as run_items};

use crate::args::Reproduce;
use crate::config::Session;
use crate::failure::Usage;
use crate::{messages, text};

/// Makes the items and the page.
pub(crate) fn run(session: &Session, typed: &Reproduce) -> anyhow::Result<()> {
    let chosen = chosen(&typed.only)?;
    if typed.list {
        for item in &chosen {
            text::say(format!("{:<14}{}: {}", item.id, item.source, item.title))?;
        }
        return Ok(());
    }
    for path in &typed.gotcha {
        if !path.is_file() {
            bail!("--gotcha {}: there is no such file", path.display());
        }
    }
    let mut claims = session.claims(&typed.writing, &typed.gotcha);
    claims.folder(&typed.out, names(&typed.out, &chosen))?;
    let start = Instant::now();
    let progress = session.progress("reproducing");
    let context = Context {
        memory_bytes: session.memory_bytes,
        monitor: &progress,
        gotcha: &typed.gotcha,
    };
    let mut agreeing = 0;
    let outcome = run_items(&chosen, &typed.out, &context, |step| match step {
        Step::Begun(item, index, count) => {
            progress.begin(format!("{}/{count} {}", index + 1, item.id));
        }
        Step::Done(item, finding) => {
            agreeing += usize::from(finding.agrees());
            let verdict = if finding.agrees() {
                "agrees"
            } else {
                "differs"
            };
            messages::note(&format!("{:<14}{verdict}  {}", item.id, item.title));
        }
    });
    progress.finish();
    outcome?;
    text::say(format!(
        "{}: {agreeing} of {} agree with the theses, in {}",
        typed.out.join("index.html").display(),
        chosen.len(),
        text::duration(start.elapsed())
    ))?;
    Ok(())
}

/// The items asked for, in the order of the page; all if none is named.
fn chosen(only: &[String]) -> anyhow::Result<Vec<Item>> {
    let all = items();
    for id in only {
        if !all.iter().any(|item| item.id == id) {
            let known: Vec<&str> = all.iter().map(|item| item.id).collect();
            return Err(Usage(format!("--only {id}: known are {}", known.join(", "))).into());
        }
    }
    let wanted = |item: &Item| only.is_empty() || only.iter().any(|id| id == item.id);
    Ok(all.into_iter().filter(wanted).collect())
}
