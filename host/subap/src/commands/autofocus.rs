//! `subap autofocus`: phases or a track by which an image is sharper.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use subaperture::autofocus::{
    Correction, Figures, MapDrift, Method, ModifiedPhaseGradient, PhaseGradient, Points,
    SharpenError, Sharpened, Sharpness, Stopping, Subject, sharpen,
};
use subaperture::focus::ImageFormer;
use subaperture::focus::forecast::Forecast;
use subaperture::geometry::ImageGrid;
use subaperture::io::atomic::write_atomically;
use subaperture::io::claim::Claims;
use subaperture::io::ours::{Kind, TEXT_MARK};
use subaperture::io::phase_csv;
use subaperture::phase_history::{Collection, Joined, PhaseHistory};
use subaperture::planner::forecast::{cost, forecast_of};
use subaperture::plot::{self, Panel, Scale};

use crate::ahead::Ahead;
use crate::args::{Autofocus, Way};
use crate::commands::forming::{self, Forming};
use crate::config::{Session, command_line, record_of_run};
use crate::{interrupt, text};

/// Of the picture's levels.
const SPAN_DB: f64 = 60.0;

/// Sharpens, says what was gained, and writes what it was gained by.
pub(crate) fn run(session: &Session, typed: &Autofocus) -> anyhow::Result<()> {
    let start = Instant::now();
    let Some((found, history)) = sharpened(session, typed)? else {
        return Ok(());
    };
    if session.json() {
        return text::say_json(
            "autofocus",
            record(session, typed, &history, &found, start)?,
        );
    }
    report(session, typed, &found, start)
}

/// Sharpens, writes what was gained by what, and prints nothing: what would be printed as JSON.
pub(crate) fn found(session: &Session, typed: &Autofocus) -> anyhow::Result<Value> {
    let start = Instant::now();
    let (found, history) = sharpened(session, typed)?.expect("it is no rehearsal");
    record(session, typed, &history, &found, start)
}

/// What was found of which recording; `None` if it was only to be said what that takes.
fn sharpened(session: &Session, typed: &Autofocus) -> anyhow::Result<Option<(Sharpened, Joined)>> {
    let former = typed.former.former()?;
    if let Some(grid) = &typed.grid {
        session.check_grid(grid, 4)?;
    }
    let _claims = claim(session, typed)?;
    let history = session.open(&typed.input)?;
    let grid = match typed.grid.clone() {
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
        windows: [typed.window, typed.slow_window],
        measure: typed.measure,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let stopping = Stopping {
        rounds: typed.rounds,
        ..Stopping::default()
    };
    let found = sharpen(&subject, &*method(typed), stopping);
    progress.finish();
    let found = found.map_err(|error| match error {
        SharpenError::Form(error) => anyhow::Error::new(error),
        error @ SharpenError::TooFewPoints { .. } => anyhow::Error::new(error)
            .context("look farther down with --within, or take another --method"),
        error => anyhow::Error::new(error),
    })?;
    interrupt::check()?;
    let correction = correction(typed, &history, &found);
    if let Some(path) = &typed.out {
        put(path, file(history.collection(), &correction).as_bytes())?;
    }
    if let Some(path) = &typed.picture {
        // One scale for both, from the brightest pixel of either.
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
        put(path, &plot::panels(&panels, 2)?)?;
    }
    Ok(Some((found, history)))
}

/// Claims what is to be written. Held until the command's end.
fn claim(session: &Session, typed: &Autofocus) -> anyhow::Result<Claims> {
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    if let Some(path) = &typed.out {
        claims.file(path, Kind::Text)?;
    }
    if let Some(path) = &typed.picture {
        claims.file(path, Kind::Picture)?;
    }
    Ok(claims)
}

/// Says what it will take, by an image a round: whether that is all that was asked for.
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
    let windows = [typed.window, typed.slow_window];
    let forming = Forming::new(session, history, grid, windows, Default::default());
    let task = forming.task(&progress);
    let one = match cost(former, &task) {
        Some(cost) => forecast_of(former, &task, &cost)?,
        None => None,
    };
    progress.finish();
    let images = typed.rounds + 1;
    let time = one.map(|one| Forecast {
        seconds: one.seconds * images as f64,
        ..one
    });
    let what = format!(
        "{images} images at most of {} x {} pixels by {}",
        grid.columns.count,
        grid.rows.count,
        former.name()
    );
    let held_bytes = history.held_bytes() + 3 * 8 * grid.num_pixels();
    Ahead::new(session, what, held_bytes, time, Vec::new()).announce(session, &typed.rehearsal)
}

/// The method that is asked for.
fn method(typed: &Autofocus) -> Box<dyn Method> {
    let points = |default: Points| Points {
        most: typed.points.unwrap_or(default.most),
        within_db: typed.within.unwrap_or(default.within_db),
    };
    match typed.method {
        Way::Pga => {
            let default = PhaseGradient::default();
            Box::new(PhaseGradient {
                estimator: typed.estimator,
                points: points(default.points),
            })
        }
        Way::MpgaImage => {
            let default = ModifiedPhaseGradient::default();
            Box::new(ModifiedPhaseGradient {
                points: points(default.points),
            })
        }
        Way::Sharpness => {
            let default = Sharpness::default();
            Box::new(Sharpness {
                unknown: typed.unknown,
                points: points(default.points),
                patch: typed.patch_pixels,
                goal: typed.goal,
            })
        }
        Way::MapDrift => Box::new(MapDrift {
            looks: typed.looks.into(),
        }),
    }
}

fn name(typed: &Autofocus) -> &'static str {
    method(typed).name()
}

/// What was found; if nothing was gained, a correction by nothing of the kind that the method finds.
fn correction(typed: &Autofocus, history: &dyn PhaseHistory, found: &Sharpened) -> Correction {
    let pulses = history.collection().pulses.len();
    found
        .correction
        .clone()
        .unwrap_or_else(|| match typed.finds_track() {
            true => Correction::Track {
                displacement_m: vec![Default::default(); pulses],
            },
            false => Correction::Phase {
                error_rad: vec![0.0; pulses],
            },
        })
}

/// The file: phases of all pulses, or the track of the first channel, half way between its antennas.
fn file(collection: &Collection, correction: &Correction) -> String {
    match correction {
        Correction::Phase { error_rad } => phase_csv::text(error_rad),
        Correction::Track { displacement_m } => {
            let mut text = format!("# {TEXT_MARK}\ntime_s,x_m,y_m,z_m\n");
            let pulses = collection.pulses.iter().take(collection.num_turns());
            for (pulse, moved_m) in pulses.zip(displacement_m) {
                let at_m = 0.5 * (pulse.transmitter_m + pulse.receiver_m) + *moved_m;
                writeln!(text, "{},{},{},{}", pulse.time_s, at_m.x, at_m.y, at_m.z)
                    .expect("text grows");
            }
            text
        }
    }
}

fn put(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    Ok(write_atomically(path, bytes.len() as u64, |file| {
        file.write_all(bytes)
    })?)
}

/// What was found, as JSON.
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
        "measure": typed.measure.to_string(),
        "gained": found.correction.is_some(),
        "rms_phase_rad": found.correction.as_ref().and_then(Correction::rms_phase_rad),
        "rms_displacement_m": found.correction.as_ref().and_then(Correction::rms_displacement_m),
        "before": found.before,
        "after": found.after,
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
    let rows = [row("before", &found.before), row("after", &found.after)];
    text::say(text::table(&["", "entropy", "contrast", "peak"], &rows))?;
    let kept = found.rounds.iter().filter(|round| round.kept).count();
    let by = match &found.correction {
        None => "nothing was gained: the recording is best as it is".to_owned(),
        Some(correction) => match (correction.rms_phase_rad(), correction.rms_displacement_m()) {
            (Some(phase), _) => format!("phases of {phase:.3} rad rms taken away"),
            (None, moved) => format!("track moved by {} rms", text::metres(moved)),
        },
    };
    text::say(format!(
        "{by}; {kept} of {} rounds kept, {} in {}",
        found.rounds.len(),
        name(typed),
        text::duration(start.elapsed())
    ))?;
    let Some(path) = &typed.out else {
        return Ok(());
    };
    if session.tells() {
        let path = path.display();
        text::say(match correction_is_phase(typed, found) {
            true => format!("written to {path}: subap focus --phase {path} takes it"),
            false => format!("written to {path}: subap focus --track {path} takes it"),
        })?;
    }
    Ok(())
}

fn correction_is_phase(typed: &Autofocus, found: &Sharpened) -> bool {
    match &found.correction {
        Some(correction) => matches!(correction, Correction::Phase { .. }),
        None => matches!(typed.method, Way::Pga | Way::MapDrift),
    }
}
