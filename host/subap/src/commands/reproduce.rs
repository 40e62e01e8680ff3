//! `subap reproduce`: reproduce figures of both theses.

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, bail};
use serde_json::{Value, json};
use subaperture_gallery::{Context, Item, Step, expect, items, names, run as run_items};

use crate::ahead::Ahead;
use crate::args::Reproduce;
use crate::config::{Session, record_of_run};
use crate::failure::Usage;
use crate::{messages, text};

/// Disk space and memory of an item, including its part of the page: the maximum of all items, rounded up.
const ITEM_BYTES: u64 = 1 << 20;
const ITEM_HELD_BYTES: u64 = 96 << 20;
/// Memory of an item at the thesis's own scale: samples, image and Keystone weights of 499 pulses with Doppler padded 16 times.
const FULL_HELD_BYTES: u64 = 9 << 30;

/// Reproduce the items and write the page.
pub(crate) fn run(session: &Session, typed: &Reproduce) -> anyhow::Result<()> {
    let chosen = chosen(&typed.only)?;
    if typed.list && session.json() {
        let items: Vec<Value> = chosen
            .iter()
            .map(|item| json!({ "id": item.id, "source": item.source, "title": item.title }))
            .collect();
        return text::say_json("reproduce-list", json!({ "items": items }));
    }
    if typed.list {
        for item in &chosen {
            text::say(format!("{:<16}{}: {}", item.id, item.source, item.title))?;
        }
        return Ok(());
    }
    let allowed_bytes = session.memory.total_bytes;
    if is_full(typed, &chosen) && !typed.rehearsal.dry_run && allowed_bytes < FULL_HELD_BYTES {
        bail!(
            "--full: expected at least {} of memory for items at the thesis's own scale, found {}: raise --memory, or leave out --full",
            text::bytes(FULL_HELD_BYTES.into()),
            text::bytes(allowed_bytes.into())
        );
    }
    let gotcha = gotcha_files(&typed.gotcha)?;
    let mut claims = session.claims(&typed.writing, &gotcha);
    claims.folder(&typed.out, names(&typed.out, &chosen))?;
    let start = Instant::now();
    let progress = session.progress("reproducing");
    let context = Context {
        memory_bytes: session.memory_bytes,
        monitor: &progress,
        gotcha: &gotcha,
        full: typed.full,
        unfinished: typed.full.then_some(&typed.out),
    };
    if typed.rehearsal.dry_run {
        let ahead = ahead(session, typed, &chosen, &context)?;
        progress.finish();
        ahead.announce(session, &typed.rehearsal)?;
        return Ok(());
    }
    let mut agreeing = 0;
    let mut verdicts = Vec::new();
    let outcome = run_items(&chosen, &typed.out, &context, |step| match step {
        Step::Begun(item, index, count) => {
            progress.begin(format!("{}/{count} {}", index + 1, item.id));
        }
        Step::Done(item, finding) => {
            agreeing += usize::from(finding.agrees());
            verdicts.push(json!({ "id": item.id, "agrees": finding.agrees() }));
            let verdict = if finding.agrees() {
                "agrees"
            } else {
                "differs"
            };
            messages::note(&format!("{:<16}{verdict}  {}", item.id, item.title));
        }
    });
    progress.finish();
    let files = outcome?;
    if session.json() {
        return text::say_json(
            "reproduce",
            json!({
                "items": verdicts,
                "agreeing": agreeing,
                "run": record_of_run(session, start.elapsed()),
                "files": files,
            }),
        );
    }
    text::say(format!(
        "{}: {agreeing} of {} agree with the theses, in {}",
        typed.out.join("index.html").display(),
        chosen.len(),
        text::duration(start.elapsed())
    ))?;
    Ok(())
}

/// Whether an item is made at the thesis's own scale.
fn is_full(typed: &Reproduce, chosen: &[Item]) -> bool {
    typed.full && chosen.iter().any(|item| item.full_work().is_some())
}

/// Predicted cost of the items.
fn ahead(
    session: &Session,
    typed: &Reproduce,
    chosen: &[Item],
    context: &Context,
) -> anyhow::Result<Ahead> {
    let expected = expect(chosen, &typed.out, context)?;
    let work = format!(
        "{} items to compute, {} already computed",
        expected.to_make, expected.there
    );
    let disk_bytes = expected.to_make as u64 * ITEM_BYTES;
    Ok(Ahead::new(
        session,
        work,
        match is_full(typed, chosen) {
            true => FULL_HELD_BYTES,
            false => ITEM_HELD_BYTES,
        },
        Some(expected.time),
        vec![(typed.out.clone(), disk_bytes)],
    ))
}

/// GOTCHA recordings: the given files, and all `.mat` files of given folders, by name.
fn gotcha_files(named: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in named {
        let about = fs::metadata(path).with_context(|| format!("--gotcha {}", path.display()))?;
        if !about.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = fs::read_dir(path).with_context(|| format!("--gotcha {}", path.display()))?;
        let mut within = Vec::new();
        for entry in entries {
            let file = entry
                .with_context(|| format!("--gotcha {}", path.display()))?
                .path();
            if file.extension().is_some_and(|ending| ending == "mat") {
                within.push(file);
            }
        }
        if within.is_empty() {
            bail!(
                "--gotcha {}: the folder contains no .mat file; give the files of AFRL's data set, such as \
                 data_3dsar_pass1_az001_HH.mat, or their folder",
                path.display()
            );
        }
        within.sort();
        files.extend(within);
    }
    Ok(files)
}

/// Requested items in the order of the page; all if none is named.
fn chosen(only: &[String]) -> anyhow::Result<Vec<Item>> {
    let all = items();
    for id in only {
        if !all.iter().any(|item| item.id == id) {
            let known: Vec<&str> = all.iter().map(|item| item.id).collect();
            return Err(Usage(format!("--only {id}: expected one of {}", known.join(", "))).into());
        }
    }
    let wanted = |item: &Item| only.is_empty() || only.iter().any(|id| id == item.id);
    Ok(all.into_iter().filter(wanted).collect())
}
