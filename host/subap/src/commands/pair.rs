//! `subap pair`: interferogram, coherence and change map of two images.

mod pictures;
mod products;
mod read;

use std::time::Instant;

use serde_json::{Value, json};
use subaperture::interferometry::{ChangeMap, Settings, detect_changes};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;

use crate::args::{Pair, PairFormat};
use crate::commands::rasters;
use crate::config::{Session, record_of_run};
use crate::{interrupt, text};
use read::Read;

/// File names of the pictures.
const PICTURES: [&str; 3] = ["coherence.png", "phase.png", "change.png"];

/// Name of the record.
const RECORD: &str = "pair.json";

/// Register two images, detect changes and write all results.
pub(crate) fn run(session: &Session, typed: &Pair) -> anyhow::Result<()> {
    let start = Instant::now();
    let has = |format| typed.formats.contains(&format);
    let mut claims = session.claims(&typed.writing, &[&typed.image, &typed.reference]);
    let maps = products::MAPS
        .iter()
        .filter(|_| has(PairFormat::Cog))
        .map(|(name, _)| *name);
    claims.folder(&typed.out, PICTURES.into_iter().chain([RECORD]))?;
    for name in maps {
        claims.file(&typed.out.join(name), Kind::Map)?;
    }
    if has(PairFormat::Zarr) {
        claims.store(&typed.out.join(products::STACK))?;
    }

    let progress = session.progress("registering");
    let read = Read::new(session, typed)?;
    if has(PairFormat::Cog) {
        rasters::check_place(&read.reference)?;
    }
    interrupt::check()?;
    let settings = Settings {
        window: typed.looks.0,
        false_alarm_probability: typed.pfa,
        coherence: typed.coherence,
        looks: None,
        floor_db: typed.floor,
    };
    let changes = detect_changes(&read.image, &read.pixels, &settings)?;
    progress.finish();
    interrupt::check()?;

    let mut about = about(typed, &read, &changes);
    let mut files = FileSet::new();
    let drawn = pictures::draw(session, &read, &changes)?;
    for (name, bytes) in PICTURES.iter().zip(drawn) {
        interrupt::check()?;
        files.write_bytes(&typed.out.join(name), FileKind::Picture, &bytes)?;
    }
    if has(PairFormat::Cog) {
        products::add_maps(session, typed, &read, &changes, &mut files)?;
    }
    let mut record = record_of_run(session, start.elapsed());
    record["schema"] = "subaperture-pair-record".into();
    record["schema_version"] = 1.into();
    record["inputs"] = json!([
        typed.image.display().to_string(),
        typed.reference.display().to_string()
    ]);
    record["pair"] = about.clone();
    let bytes = serde_json::to_vec_pretty(&record)?;
    files.write_bytes(&typed.out.join(RECORD), FileKind::Record, &bytes)?;
    let mut files = files.commit()?;
    if has(PairFormat::Zarr) {
        files.push(products::write_stack(session, typed, &read, &changes)?);
    }
    if session.json() {
        about["files"] = json!(files);
        return text::say_json("pair", about);
    }
    if session.prints_text() {
        text::say(describe(typed, &read, &changes))?;
    }
    Ok(())
}

/// Figures of the pair.
fn about(typed: &Pair, read: &Read, changes: &ChangeMap) -> Value {
    json!({
        "looks": { "rows": typed.looks.0[0], "columns": typed.looks.0[1] },
        "effective_looks": changes.looks,
        "offset_pixels": read.offset,
        "offset_removed": read.corrected,
        "scene_coherence": changes.coherence,
        "scene_coherence_estimated": typed.coherence.is_none(),
        "mean_coherence": changes.interferogram.magnitude().mean(),
        "false_alarm_probability": typed.pfa,
        "threshold": changes.threshold,
        "fraction_changed": changes.counts.fraction_changed(),
        "pixels": changes.counts,
        "notes": read.notes,
    })
}

fn describe(typed: &Pair, read: &Read, changes: &ChangeMap) -> String {
    let [rows, columns] = typed.looks.0;
    let counts = &changes.counts;
    let offset = match &read.offset {
        Some(offset) => format!(
            "{:.3} rows, {:.3} columns{}, correlation {:.3}",
            offset.rows,
            offset.columns,
            if read.corrected {
                ", removed"
            } else {
                ", within tolerance"
            },
            offset.correlation
        ),
        None => "not estimated".to_owned(),
    };
    let estimated = match typed.coherence {
        None => ", estimated from the median",
        Some(_) => ", given",
    };
    let mut lines = vec![
        format!("offset               {offset}"),
        format!(
            "looks                {rows} x {columns} pixels, {:.1} independent",
            changes.looks
        ),
        format!("scene coherence      {:.4}{estimated}", changes.coherence),
        format!(
            "threshold            {:.4} for a false-alarm probability of {}",
            changes.threshold, typed.pfa
        ),
        format!(
            "changed              {:.4} % of {} tested pixels",
            100.0 * counts.fraction_changed(),
            counts.changed + counts.unchanged
        ),
        format!(
            "not tested           {} of low power, {} without a full window",
            counts.masked, counts.undefined
        ),
    ];
    let notes = read.notes.iter();
    lines.extend(notes.map(|note| format!("note                 {note}")));
    lines.push(typed.out.display().to_string());
    lines.join("\n")
}
