//! `subap autofocus`: estimate phase errors or the track from the image.

use std::fmt::Write as _;
use std::time::Instant;

use serde_json::{Value, json};
use subaperture::autofocus::{
    Correction, Figures, HELD_IMAGES, MapDrift, Method, ModifiedPhaseGradient, Outcome,
    PhaseGradient, Points, SIGNIFICANCE, SharpenError, Sharpened, Sharpness, Stopping, Subject,
    most_images, sharpen,
};
use subaperture::focus::forecast::Forecast;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::io::claim::OutputClaims;
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::io::{phase_csv, track_csv};
use subaperture::phase_history::{Collection, Joined, PhaseHistory, Weights};
use subaperture::planner::forecast::{cost, forecast_of};
use subaperture::plot::{self, Panel, Scale};
use subaperture::track::Fix;

use crate::ahead::Ahead;
use crate::args::{self, Autofocus};
use crate::commands::forming;
use crate::config::{Session, command_line, record_of_run};
use crate::{interrupt, messages, text};

/// Dynamic range of the picture, dB.
const SPAN_DB: f64 = 60.0;

/// Estimate a correction, print the results and write the files.
pub(crate) fn run(session: &Session, typed: &Autofocus) -> anyhow::Result<()> {
    let start = Instant::now();
    let Some((found, history, files)) = sharpened(session, typed)? else {
        return Ok(());
    };
    if session.json() {
        let mut record = record(session, typed, &history, &found, start)?;
        record["files"] = json!(files);
        return text::say_json("autofocus", record);
    }
    report(session, typed, &found, start)
}

/// Estimate a correction and write the files. Returns the record and the files.
pub(crate) fn estimate(
    session: &Session,
    typed: &Autofocus,
) -> anyhow::Result<(Value, Vec<WrittenFile>)> {
    let start = Instant::now();
    let (found, history, files) = sharpened(session, typed)?.expect("not a dry run");
    Ok((record(session, typed, &history, &found, start)?, files))
}

/// Estimated correction, the recording and the written files; `None` for a dry run.
fn sharpened(
    session: &Session,
    typed: &Autofocus,
) -> anyhow::Result<Option<(Sharpened, Joined, Vec<WrittenFile>)>> {
    let former = typed.former.former()?;
    if let Some(grid) = &typed.settings.grid {
        session.check_grid(grid, 4)?;
    }
    let _claims = claim(session, typed)?;
    let history = session.open(&typed.input)?;
    let grid = match typed.settings.grid.clone() {
        Some(grid) => grid,
        None => session.default_grid(&forming::survey(&history)?)?,
    };
    session.check_grid(&grid, 4)?;
    if ahead(session, typed, &history, &grid, &*former)? {
        return Ok(None);
    }
    let progress = session.progress("autofocus");
    let subject = Subject {
        history: &history,
        grid: &grid,
        former: &*former,
        windows: typed.windows.both(),
        measure: typed.settings.measure,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let stopping = Stopping {
        rounds: typed.settings.rounds,
        keep_unjudged: typed.keep_unjudged,
        ..Stopping::default()
    };
    let found = sharpen(&subject, &*method(typed), stopping);
    progress.finish();
    let found = found.map_err(|error| match error {
        SharpenError::Form(error) => anyhow::Error::new(error),
        error @ SharpenError::TooFewPoints { .. } => anyhow::Error::new(error)
            .context("extend the search with --within, or use another --method"),
        error => anyhow::Error::new(error),
    })?;
    interrupt::check()?;
    if let Some(warning) = doubt(&found) {
        messages::bound_missed(warning);
    }
    let correction = correction(typed, &history, &found);
    let mut files = FileSet::new();
    if let Some(path) = &typed.out {
        let text = file(history.collection(), &correction);
        let kind = match correction_is_phase(typed, &found) {
            true => FileKind::PhaseCorrection,
            false => FileKind::Track,
        };
        files.write_bytes(path, kind, text.as_bytes())?;
    }
    if let Some(path) = &typed.picture {
        // Common scale for both images, relative to the brighter peak.
        let scale = Scale::Fixed {
            top_db: found.before.peak_db.max(found.after.peak_db).ceil(),
            span_db: SPAN_DB,
        };
        let panel = |image, title: String| Panel {
            scale,
            ..Panel::new(image, &grid, title)
        };
        let panels = [
            panel(&found.image_before, "as recorded".to_owned()),
            panel(&found.image_after, format!("by {}", name(typed))),
        ];
        files.write_bytes(path, FileKind::Picture, &plot::panels(&panels, 2)?)?;
    }
    let files = files.commit()?;
    Ok(Some((found, history, files)))
}

/// Claim the output files. The claim lasts until the command ends.
fn claim(session: &Session, typed: &Autofocus) -> anyhow::Result<OutputClaims> {
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    if let Some(path) = &typed.out {
        claims.file(path, Kind::Text)?;
    }
    if let Some(path) = &typed.picture {
        claims.file(path, Kind::Picture)?;
    }
    Ok(claims)
}

/// Print the predicted cost of a dry run, from one image per round. Returns whether this was a dry run.
fn ahead(
    session: &Session,
    typed: &Autofocus,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    former: &dyn ImageFormer,
) -> anyhow::Result<bool> {
    if !typed.rehearsal.dry_run {
        return Ok(false);
    }
    let progress = session.progress("measuring");
    let task = Task {
        history,
        grid,
        weights: &Weights::new(
            history.collection(),
            typed.windows.window,
            typed.windows.slow_window,
        ),
        numerics: Default::default(),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let one = match cost(former, &task) {
        Some(cost) => forecast_of(former, &task, &cost)?,
        None => None,
    };
    progress.finish();
    let images = most_images(typed.settings.rounds, typed.settings.finds_track());
    let time = one.map(|one| Forecast {
        seconds: one.seconds * images as f64,
        ..one
    });
    let quantity = format!(
        "at most {images} images of {} x {} pixels by {}",
        grid.columns.count,
        grid.rows.count,
        former.name()
    );
    let held_bytes = history.held_bytes() + HELD_IMAGES * 8 * grid.num_pixels();
    Ahead::new(session, quantity, held_bytes, time, Vec::new()).announce(session, &typed.rehearsal)
}

/// Autofocus method with its options.
fn method(typed: &Autofocus) -> Box<dyn Method> {
    let points = |default: Points| Points {
        most: typed.settings.points.unwrap_or(default.most),
        within_db: typed.settings.within.unwrap_or(default.within_db),
    };
    match typed.settings.method {
        args::Method::Pga => {
            let default = PhaseGradient::default();
            Box::new(PhaseGradient {
                estimator: typed.settings.estimator,
                points: points(default.points),
            })
        }
        args::Method::MpgaImage => {
            let default = ModifiedPhaseGradient::default();
            Box::new(ModifiedPhaseGradient {
                points: points(default.points),
            })
        }
        args::Method::Sharpness => {
            let default = Sharpness::default();
            Box::new(Sharpness {
                unknown: typed.settings.unknown,
                points: points(default.points),
                patch: typed.settings.patch_pixels,
                goal: typed.settings.goal,
            })
        }
        args::Method::MapDrift => Box::new(MapDrift {
            looks: typed.settings.looks.into(),
        }),
    }
}

fn name(typed: &Autofocus) -> &'static str {
    method(typed).name()
}

/// Correction; zeros of the kind the method estimates if there is none.
fn correction(typed: &Autofocus, history: &dyn PhaseHistory, found: &Sharpened) -> Correction {
    let pulses = history.collection().pulses.len();
    found
        .correction
        .clone()
        .unwrap_or_else(|| match typed.settings.finds_track() {
            true => Correction::Track {
                displacement_m: vec![Default::default(); pulses],
            },
            false => Correction::Phase {
                error_rad: vec![0.0; pulses],
            },
        })
}

/// Output file: phases of all pulses, or the track of the first channel, midway between its antennas.
fn file(collection: &Collection, correction: &Correction) -> String {
    match correction {
        Correction::Phase { error_rad } => phase_csv::text(error_rad),
        Correction::Track { displacement_m } => {
            let pulses = collection.pulses.iter().take(collection.num_turns());
            let fixes = pulses.zip(displacement_m).map(|(pulse, moved_m)| Fix {
                time_s: pulse.time_s,
                position_m: pulse.phase_centre_m() + *moved_m,
                attitude: None,
            });
            track_csv::text(&fixes.collect::<Vec<_>>())
        }
    }
}

/// The result as JSON.
fn record(
    session: &Session,
    typed: &Autofocus,
    history: &dyn PhaseHistory,
    found: &Sharpened,
    start: Instant,
) -> anyhow::Result<Value> {
    Ok(json!({
        "schema": "subaperture-autofocus",
        "schema_version": 1,
        "run": record_of_run(session, start.elapsed()),
        "command_line": command_line(),
        "method": name(typed),
        "algorithm": typed.former.record(),
        "measure": typed.settings.measure.to_string(),
        "gained": found.outcome == Outcome::Sharper,
        "kept": found.correction.is_some(),
        "outcome": found.outcome,
        "rms_phase_rad": found.correction.as_ref().and_then(Correction::rms_phase_rad),
        "rms_displacement_m": found.correction.as_ref().and_then(Correction::rms_displacement_m),
        "before": found.before,
        "after": found.after,
        "held_out": found.held_out,
        "rounds": found.rounds,
        "inputs": history.inputs()?,
    }))
}

fn report(
    session: &Session,
    typed: &Autofocus,
    found: &Sharpened,
    start: Instant,
) -> anyhow::Result<()> {
    let row = |name: &str, figures: &Figures| {
        vec![
            name.to_owned(),
            format!("{:.4}", figures.entropy),
            format!("{:.4}", figures.contrast),
            text::decibels(figures.peak_db),
        ]
    };
    let mut rows = vec![row("before", &found.before), row("after", &found.after)];
    if let Some(held_out) = &found.held_out {
        rows.push(row("held out, before", &held_out.before));
        rows.push(row("held out, after", &held_out.after));
    }
    text::say(text::table(&["", "entropy", "contrast", "peak"], &rows))?;
    let kept = found.rounds.iter().filter(|round| round.kept).count();
    let by = match &found.correction {
        None => "no correction".to_owned(),
        Some(correction) => match (correction.rms_phase_rad(), correction.rms_displacement_m()) {
            (Some(phase), _) => format!("phases corrected by {phase:.3} rad RMS"),
            (None, moved) => format!("track corrected by {} RMS", text::metres(moved)),
        },
    };
    text::say(format!(
        "{by}; {kept} of {} rounds kept, {} in {}",
        found.rounds.len(),
        name(typed),
        text::duration(start.elapsed())
    ))?;
    text::say(judgement(found))?;
    let Some(path) = &typed.out else {
        return Ok(());
    };
    if session.prints_text() {
        let path = path.display();
        text::say(match correction_is_phase(typed, found) {
            true => format!("written to {path}: apply it with subap focus --phase {path}"),
            false => format!("written to {path}: apply it with subap focus --track {path}"),
        })?;
    }
    Ok(())
}

/// Result of the test on held-out data, as one line.
fn judgement(found: &Sharpened) -> String {
    let Some(held_out) = &found.held_out else {
        return match found.outcome {
            Outcome::NothingFound => "no tested correction sharpens the image".to_owned(),
            _ => "not judged on held-out data: the figures are those of the data used to estimate"
                .to_owned(),
        };
    };
    let mut text = format!(
        "{}: on range cells not used for the estimate: entropy {:.4} before, {:.4} after; probability of such a gain by chance {} over {} segments",
        match held_out.sharper {
            true => "sharper on held-out data",
            false => "not accepted on held-out data",
        },
        held_out.before.entropy,
        held_out.after.entropy,
        probability(held_out.p_value),
        held_out.segments
    );
    if let (Some(error_m), Some(p_value)) = (held_out.track_error_m, held_out.track_p_value) {
        let error = text::metres(Some(error_m));
        let p_value = probability(p_value);
        write!(
            text,
            "; track error {error} RMS by the jackknife, probability {p_value} if the track were no better than the recorded one"
        )
        .expect("text grows");
    }
    text
}

fn probability(p: f64) -> String {
    match p < 1e-4 {
        true => "below 0.0001".to_owned(),
        false => format!("{p:.4}"),
    }
}

const LESS_THAN_A_QUARTER: &str =
    "held-out range cells gain less than a quarter of the gain on the cells used";

/// Reason why a correction is refused, or kept untested.
fn doubt(found: &Sharpened) -> Option<String> {
    let quantity = |correction: &Option<Correction>| match correction {
        Some(Correction::Track { .. }) => "track",
        _ => "phases",
    };
    let limit = SIGNIFICANCE;
    match (found.outcome, &found.held_out) {
        (Outcome::NotSharper, held_out) => {
            let quantity = quantity(&found.refused);
            let reason = match held_out {
                Some(held_out) if quantity == "track" && held_out.p_value >= limit => format!(
                    "expected a gain on held-out range cells with a probability by chance below {limit}, found {}",
                    probability(held_out.p_value)
                ),
                Some(held_out) if quantity == "track" => match held_out.track_p_value {
                    Some(p_value) if p_value >= limit => format!(
                        "expected a track better than the recorded one with a probability of error below {limit}, found {}",
                        probability(p_value)
                    ),
                    None if !held_out.far => "some of the held-out folds give no track".to_owned(),
                    _ => match (held_out.largest_step_rad, held_out.max_step_rad) {
                        (Some(step_rad), Some(limit_rad)) if step_rad >= limit_rad => format!(
                            "expected displacements that change the two-way phase by less than {limit_rad:.2} rad between pulses, found {step_rad:.2}: \
                             half-wavelength slips are possible, which no image shows"
                        ),
                        _ => LESS_THAN_A_QUARTER.to_owned(),
                    },
                },
                _ => LESS_THAN_A_QUARTER.to_owned(),
            };
            Some(format!(
                "{quantity}: correction refused, {quantity} unchanged: {reason}"
            ))
        }
        (Outcome::Unjudged, _) => Some(match (&found.correction, &found.refused) {
            (kept @ Some(_), _) => format!(
                "{}: correction kept without a judgement: bright points lie in too few range cells to hold some of them out; \
                 its sharpness is that of the data it was estimated from",
                quantity(kept)
            ),
            (None, refused) => {
                let quantity = quantity(refused);
                format!(
                    "{quantity}: correction refused, {quantity} unchanged: bright points lie in too few range cells to hold some of them out; \
                     --keep-unjudged keeps it"
                )
            }
        }),
        _ => None,
    }
}

fn correction_is_phase(typed: &Autofocus, found: &Sharpened) -> bool {
    match &found.correction {
        Some(correction) => matches!(correction, Correction::Phase { .. }),
        None => !typed.settings.finds_track(),
    }
}
