//! `subap tune`: calibrate unknown geometry parameters by maximising image sharpness.

mod measure;
mod pictures;
mod written;

use std::time::Instant;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::autofocus::{
    Expected, Model, Order, Problem, Scan, Search, Sight, TuneError, Tuned, Verdict, determine,
    rehearse,
};
use subaperture::convention::INFERENCE;
use subaperture::focus::FormError;
use subaperture::focus::forecast::Forecast;
use subaperture::io::claim::OutputClaims;
use subaperture::io::recording::{RecordingFile, Take};
use subaperture::io::together::FileSet;
use subaperture::phase_history::InMemory;

use crate::ahead::Ahead;
use crate::args::{Tune, Vary};
use crate::config::{Session, record_of_run};
use crate::failure::Usage;
use crate::{interrupt, messages, text};
use measure::{figure, measure_name, rounded};

/// Maximum number of keys varied together: each triples the number of neighbours of the best value.
const MAX_KEYS: usize = 3;

/// Search, report the result, and write pictures if requested.
pub(crate) fn run(session: &Session, typed: &Tune) -> anyhow::Result<()> {
    let start = Instant::now();
    let keys = &typed.vary;
    let _claims = check_and_claim(session, typed)?;
    let mut recording = RecordingFile::read_within(&typed.recording, session.memory_bytes)
        .with_context(|| format!("cannot read {}", typed.recording.display()))?;
    for (key, value) in &typed.set {
        recording.set(key, value)?;
    }
    let varied = Varied {
        recording: &recording,
        keys,
        memory_bytes: session.memory_bytes,
    };
    varied.check_ends()?;
    for (key, value) in varied.inferred()? {
        messages::note(&format!(
            "{key} = \"{value}\" (inferred: gives the sharpest image of the possible values)"
        ));
        recording.set(key, value)?;
    }
    let varied = Varied {
        recording: &recording,
        keys,
        memory_bytes: session.memory_bytes,
    };
    let sight = sight(typed);
    let intervals: Vec<_> = keys.iter().map(|vary| vary.axis).collect();
    let progress = session.progress("tuning");
    let problem = Problem {
        model: &varied,
        intervals: &intervals,
        search: search(typed),
        sight: &sight,
        windows: typed.windows.both(),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    if typed.rehearsal.dry_run {
        let ahead = ahead(session, &problem)?;
        progress.finish();
        ahead.announce(session, &typed.rehearsal)?;
        return Ok(());
    }
    let found = determine(&problem);
    progress.finish();
    let found = found.map_err(|error| match error {
        TuneError::Failed(error) => anyhow::Error::new(error),
        TuneError::Cancelled => FormError::Cancelled.into(),
        error => anyhow::Error::new(error),
    })?;
    interrupt::check()?;
    let record = record(session, typed, &found, &recording, start)?;
    let mut files = FileSet::new();
    if let Some(folder) = &typed.out {
        let tuned = varied.history(&found.best)?;
        pictures::add_to(
            &mut files,
            session,
            typed,
            folder,
            &record,
            &found,
            [&recording.history(session.memory_bytes), &Ok(tuned)],
        )?;
    }
    if !session.json() {
        report(typed, &found, start)?;
    }
    let values: Vec<(&str, String)> = keys
        .iter()
        .zip(&found.best)
        .map(|(vary, &best)| (vary.key.as_str(), vary.text(rounded(vary, best))))
        .collect();
    let file = match check_determined(typed, &found) {
        Ok(()) => written::add_to(&mut files, typed, &recording, &values)?,
        Err(error) => {
            // The record and the pictures document the reason.
            files.commit()?;
            return Err(error);
        }
    };
    let outputs = files.commit()?;
    if session.json() {
        let mut record = record;
        record["files"] = json!(outputs);
        return text::say_json("tune", record);
    }
    text::say(match file {
        Some(file) => format!("written to {}", file.display()),
        None => format!(
            "to apply it: add --write, or use {}",
            values
                .iter()
                .map(|(key, value)| format!("--set {key}=\"{value}\""))
                .collect::<Vec<_>>()
                .join(" ")
        ),
    })?;
    Ok(())
}

/// Check the options before any file is read, and claim the outputs. The claim lasts until the command ends.
fn check_and_claim(session: &Session, typed: &Tune) -> anyhow::Result<OutputClaims> {
    let keys = &typed.vary;
    if keys.len() > MAX_KEYS {
        return Err(Usage(format!("--vary: at most {MAX_KEYS} keys")).into());
    }
    let twice = |i: usize| keys[..i].iter().any(|other| other.key == keys[i].key);
    if let Some(i) = (0..keys.len()).find(|&i| twice(i)) {
        return Err(Usage(format!("--vary {}: given twice", keys[i].key)).into());
    }
    if let Some(grid) = &typed.grid {
        session.check_grid(grid, 1)?;
    }
    written::check(typed)?;
    let mut claims = session.claims(&typed.writing, &[&typed.recording]);
    if let Some(folder) = &typed.out {
        let own = ["tune.json", "map.png", "image.png"].map(str::to_owned);
        let keys = keys.iter().map(|vary| format!("{}.png", vary.key));
        claims.folder(folder, keys.chain(own))?;
    }
    Ok(claims)
}

/// Part of the scene that is imaged.
fn sight(typed: &Tune) -> Sight {
    match typed.grid.clone() {
        Some(grid) => Sight::Grid(grid, typed.measure),
        None => Sight::Points(typed.at.clone()),
    }
}

/// Search strategy for values.
fn search(typed: &Tune) -> Search {
    Search {
        order: if typed.in_turn {
            Order::InTurn
        } else {
            Order::Product
        },
        refinements: typed.refine.into(),
    }
}

/// Result of the search as JSON.
fn record(
    session: &Session,
    typed: &Tune,
    found: &Tuned,
    recording: &RecordingFile,
    start: Instant,
) -> anyhow::Result<Value> {
    let keys = &typed.vary;
    Ok(json!({
        "schema": "subaperture-tune",
        "schema_version": 1,
        "run": record_of_run(session, start.elapsed()),
        "measure": measure_name(typed),
        "merit": found.merit,
        "evaluations": found.evaluations,
        "keys": keys.iter().zip(&found.best).zip(&found.scans).map(|((vary, best), scan)| json!({
            "key": vary.key,
            "unit": vary.unit,
            "best": best,
            "width": scan.width,
            "at_end": scan.at_end,
            "error_95": scan.error,
            "verdict": scan.verdict,
            "rivals": scan.rivals,
            "scan": scan.points,
        })).collect::<Vec<_>>(),
        "without_parts": found.without_parts,
        "inputs": recording.inputs()?,
    }))
}

/// Fail if values are to be written that the search did not determine, or whose error is unknown: the search's best value alone
/// does not show that the data determine it.
fn check_determined(typed: &Tune, found: &Tuned) -> anyhow::Result<()> {
    let open: Vec<&str> = typed
        .vary
        .iter()
        .zip(&found.scans)
        .filter(|(_, scan)| scan.verdict != Verdict::Determined)
        .map(|(vary, _)| vary.key.as_str())
        .collect();
    if !open.is_empty() && (typed.write || typed.write_to.is_some()) {
        anyhow::bail!(
            "{}: expected a value that the data determine; no file was written: widen or narrow the interval (3 values at least), \
             use another --grid or --measure, more pulses, or points of known position (--at); to use the value nonetheless, write the line yourself",
            open.join(", ")
        );
    }
    Ok(())
}

/// Predicted cost of the search, from one image.
fn ahead(session: &Session, problem: &Problem) -> anyhow::Result<Ahead> {
    let Expected {
        images,
        each,
        held_bytes,
    } = rehearse(problem)?;
    let (pixels, imaged) = match problem.sight {
        Sight::Grid(grid, _) => {
            let (columns, rows) = (grid.columns.count, grid.rows.count);
            (grid.num_pixels(), format!("{columns} x {rows} pixels"))
        }
        Sight::Points(points) => (points.len() as u64, format!("{} points", points.len())),
    };
    // Samples, the image, and an image of a sub-aperture.
    let held_bytes = held_bytes + 16 * pixels;
    let time = Forecast {
        seconds: images as f64 * each.as_secs_f64(),
        measured_s: each.as_secs_f64(),
    };
    let work = format!("about {images} images of {imaged}");
    Ok(Ahead::new(
        session,
        work,
        held_bytes,
        Some(time),
        Vec::new(),
    ))
}

/// Recording whose keys are varied.
struct Varied<'a> {
    recording: &'a RecordingFile,
    keys: &'a [Vary],
    memory_bytes: u64,
}

impl Varied<'_> {
    fn set(&self, values: &[f64]) -> Result<RecordingFile, FormError> {
        let texts: Vec<String> = self
            .keys
            .iter()
            .zip(values)
            .map(|(vary, &v)| vary.text(v))
            .collect();
        let settings = self.keys.iter().zip(&texts);
        let settings = settings.map(|(vary, text)| (vary.key.as_str(), text.as_str()));
        let varied = self.recording.with(settings);
        varied.map_err(|error| FormError::Read(error.into()))
    }

    fn history(&self, values: &[f64]) -> Result<InMemory, FormError> {
        Ok(self.set(values)?.history(self.memory_bytes)?)
    }

    /// Keys missing in the description that the samples decide, with the varied keys at the centres of their intervals.
    fn inferred(&self) -> anyhow::Result<Vec<(&'static str, &'static str)>> {
        let middles = self
            .keys
            .iter()
            .map(|vary| vary.axis.at(vary.axis.count / 2));
        let middle = self.set(&middles.collect::<Vec<f64>>())?;
        Ok(middle.inferred(&INFERENCE, self.memory_bytes)?)
    }

    /// Check the keys at both ends of their intervals.
    fn check_ends(&self) -> Result<(), FormError> {
        // Faults of a key are reported before long work.
        for end in [0, usize::MAX] {
            let values = self
                .keys
                .iter()
                .map(|vary| vary.axis.at(end.min(vary.axis.count - 1)));
            self.check(&values.collect::<Vec<f64>>())?;
        }
        Ok(())
    }

    fn check(&self, values: &[f64]) -> Result<(), FormError> {
        self.history(values).map(drop)
    }
}

impl Model for Varied<'_> {
    fn take(&self, values: &[f64], pulses: Option<&[usize]>) -> Result<Take, FormError> {
        Ok(self.set(values)?.take(self.memory_bytes, pulses)?)
    }
}

/// Verdict on a result in words.
fn verdict_text(scan: &Scan, with_unit: &dyn Fn(f64) -> String) -> String {
    match scan.verdict {
        Verdict::Determined => String::new(),
        Verdict::AtEnd => {
            "NOT DETERMINED: the best value is at an end of the interval: widen it".to_owned()
        }
        Verdict::Open => {
            "NOT DETERMINED: sub-apertures disagree over the whole interval".to_owned()
        }
        Verdict::Ambiguous => {
            let others: Vec<String> = scan.rivals.iter().take(4).map(|&v| with_unit(v)).collect();
            format!(
                "NOT DETERMINED: within the noise, equally good: {}",
                others.join(" or ")
            )
        }
        Verdict::Unknown => {
            "NOT DETERMINED: error unknown: too few pulses, or an interval of two values".to_owned()
        }
    }
}

fn report(typed: &Tune, found: &Tuned, start: Instant) -> anyhow::Result<()> {
    let rows: Vec<Vec<String>> = typed
        .vary
        .iter()
        .zip(found.best.iter().zip(&found.scans))
        .map(|(vary, (&best, scan))| {
            // Digits to a tenth of the error, else to a hundredth of the width or of the step.
            let fine = match scan.error {
                Some(error) => error / 10.0,
                None => scan.width.unwrap_or(vary.axis.step) / 100.0,
            };
            let digits = (-fine.log10()).ceil().clamp(0.0, 9.0) as usize;
            let with_unit = |value: f64| {
                format!("{value:.digits$} {}", vary.unit)
                    .trim_end()
                    .to_owned()
            };
            let known = matches!(scan.verdict, Verdict::Determined | Verdict::Ambiguous);
            vec![
                vary.key.clone(),
                with_unit(best),
                match scan.error.filter(|_| known) {
                    Some(error) => format!("+- {}", with_unit(error)),
                    None => String::new(),
                },
                match scan.width {
                    Some(width) => with_unit(width),
                    None => "wider than the interval".to_owned(),
                },
                verdict_text(scan, &with_unit),
            ]
        })
        .collect();
    text::say(text::table(
        &["key", "best", "95 %", "width of peak", ""],
        &rows,
    ))?;
    text::say(format!(
        "{} {:.6} after {} images in {}",
        measure_name(typed),
        figure(typed, found.merit),
        found.evaluations,
        text::duration(start.elapsed())
    ))?;
    Ok(())
}
