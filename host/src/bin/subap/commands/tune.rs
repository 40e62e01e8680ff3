//! `subap tune`: unknown geometry found by the sharpness of the image.

mod pictures;

use std::time::Instant;

use anyhow::Context;
use serde_json::json;
use subaperture::focus::FormError;
use subaperture::io::recording::RecordingFile;
use subaperture::phase_history::Recorded;
use subaperture::tune::{Measure, Order, Search, Sight, TuneError, Tuned, merit, search};

use crate::args::{Tune, Vary};
use crate::config::{Session, record_of_run};
use crate::failure::Usage;
use crate::{interrupt, text};

/// Keys that are varied together, at most: each makes the neighbourhood of the best three times as large.
const MOST_KEYS: usize = 3;

/// Searches, says what was found, and leaves pictures if they are wanted.
pub(crate) fn run(session: &Session, typed: &Tune) -> anyhow::Result<()> {
    let start = Instant::now();
    let keys = &typed.vary;
    if keys.len() > MOST_KEYS {
        return Err(Usage(format!("--vary: at most {MOST_KEYS} keys")).into());
    }
    let twice = |i: usize| keys[..i].iter().any(|other| other.key == keys[i].key);
    if let Some(i) = (0..keys.len()).find(|&i| twice(i)) {
        return Err(Usage(format!("--vary {}: given twice", keys[i].key)).into());
    }
    if let Some(grid) = &typed.grid {
        session.check_grid(grid, 1)?;
    }
    let mut claims = session.claims(&typed.writing, &[&typed.recording]);
    if let Some(folder) = &typed.out {
        let own = ["tune.json", "map.png", "image.png"].map(str::to_owned);
        let keys = keys.iter().map(|vary| format!("{}.png", vary.key));
        claims.folder(folder, keys.chain(own))?;
    }
    let mut recording = RecordingFile::read(&typed.recording)
        .with_context(|| format!("cannot read {}", typed.recording.display()))?;
    for (key, value) in &typed.set {
        recording.set(key, value)?;
    }
    let varied = Varied {
        recording: &recording,
        keys,
        memory_bytes: session.memory_bytes,
    };
    // What is wrong with a key is said before long work, with both of its ends.
    for end in [0, usize::MAX] {
        let values = keys
            .iter()
            .map(|vary| vary.axis.at(end.min(vary.axis.count - 1)));
        varied.check(&values.collect::<Vec<f64>>())?;
    }
    let sight = match typed.grid {
        Some(grid) => Sight::Grid(grid, typed.measure),
        None => Sight::Points(typed.at.clone()),
    };
    let wanted = Search {
        order: if typed.in_turn {
            Order::InTurn
        } else {
            Order::Product
        },
        refinements: typed.refine.into(),
    };
    let intervals: Vec<_> = keys.iter().map(|vary| vary.axis).collect();
    let progress = session.progress("tuning");
    let windows = [typed.window, typed.slow_window];
    let found = search(&intervals, wanted, &progress, |values| {
        let history = varied.history(values)?;
        merit(&history, &sight, windows, session.memory_bytes, &progress)
    });
    progress.finish();
    let found = found.map_err(|error| match error {
        TuneError::Failed(error) => anyhow::Error::new(error),
        TuneError::Cancelled => FormError::Cancelled.into(),
        TuneError::Nothing => anyhow::Error::new(error),
    })?;
    interrupt::check()?;
    if let Some(folder) = &typed.out {
        let record = json!({
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
                "scan": scan.points,
            })).collect::<Vec<_>>(),
            "inputs": recording.inputs()?,
        });
        let tuned = varied.history(&found.best)?;
        pictures::write(
            session,
            typed,
            folder,
            &record,
            &found,
            [&recording.history(session.memory_bytes), &Ok(tuned)],
        )?;
    }
    report(typed, &found, start)
}

/// A recording whose keys take values.
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

    fn history(&self, values: &[f64]) -> Result<Recorded, FormError> {
        Ok(self.set(values)?.history(self.memory_bytes)?)
    }

    fn check(&self, values: &[f64]) -> Result<(), FormError> {
        self.history(values).map(drop)
    }
}

/// The measure and its unit, as the user knows it.
fn measure_name(typed: &Tune) -> String {
    match typed.grid {
        Some(_) => typed.measure.to_string(),
        None => "power at the points".to_owned(),
    }
}

/// Whether the measure is less the sharper the image, so that its merit is its negative.
fn less_is_better(typed: &Tune) -> bool {
    typed.grid.is_some() && typed.measure == Measure::Entropy
}

/// The measure of which this is the merit.
fn figure(typed: &Tune, merit: f64) -> f64 {
    if less_is_better(typed) { -merit } else { merit }
}

/// To a ten-thousandth of the step: far below what is told apart, and short to read.
fn rounded(vary: &Vary, value: f64) -> f64 {
    let digits = (4.0 - vary.axis.step.log10()).ceil().clamp(0.0, 15.0) as usize;
    format!("{value:.digits$}").parse().unwrap_or(value)
}

fn report(typed: &Tune, found: &Tuned, start: Instant) -> anyhow::Result<()> {
    let rows: Vec<Vec<String>> = typed
        .vary
        .iter()
        .zip(found.best.iter().zip(&found.scans))
        .map(|(vary, (&best, scan))| {
            // Digits down to a hundredth of the width, or of the step.
            let fine = scan.width.unwrap_or(vary.axis.step) / 100.0;
            let digits = (-fine.log10()).ceil().clamp(0.0, 9.0) as usize;
            vec![
                vary.key.clone(),
                format!("{best:.digits$} {}", vary.unit)
                    .trim_end()
                    .to_owned(),
                match scan.width {
                    Some(width) => format!("{width:.digits$} {}", vary.unit)
                        .trim_end()
                        .to_owned(),
                    None => "not within the interval".to_owned(),
                },
                match scan.at_end {
                    true => "at an end of its interval: widen it".to_owned(),
                    false => String::new(),
                },
            ]
        })
        .collect();
    text::say(text::table(&["key", "best", "width", ""], &rows))?;
    text::say(format!(
        "{} {:.6} after {} images in {}",
        measure_name(typed),
        figure(typed, found.merit),
        found.evaluations,
        text::duration(start.elapsed())
    ))?;
    let settings: Vec<String> = typed
        .vary
        .iter()
        .zip(&found.best)
        .map(|(vary, &best)| format!("{} = \"{}\"", vary.key, vary.text(rounded(vary, best))))
        .collect();
    text::say(settings.join("\n"))?;
    Ok(())
}
