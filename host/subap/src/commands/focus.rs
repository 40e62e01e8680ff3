//! `subap focus`: recordings in, an image and its record out.

mod check;
mod from_maps;
mod record;
pub(crate) mod tiled;

use std::time::Instant;

use serde_json::{Map, Value};
use subaperture::focus::moving::Moving;
use subaperture::focus::{FormError, Formed, ImageFormer};
use subaperture::image::Image;
use subaperture::io::product::record::Brightest;
use subaperture::phase_history::PhaseHistory;
use subaperture::planner::forecast;
use subaperture::plot::{Orientation, Panel};
use subaperture::resolution::support::RecordedLooks;

use crate::args::{Focus, Mode};
use crate::commands::forming::{self, Forming};
use crate::config::{DEFAULT_ERROR_DB, Session, former};
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// Forms the image and writes its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    if let Some(path) = &typed.from_maps {
        return from_maps::run(session, typed, path);
    }
    if typed.tiled.wanted() {
        return tiled::run(session, typed);
    }
    if typed.tiled.scratch.is_some() {
        return Err(
            Usage("--scratch is for --tiled and for plans: leave it out".to_owned()).into(),
        );
    }
    let start = Instant::now();
    // What can be refused is refused before anything is read.
    let former = former(typed)?;
    if let Some(grid) = &typed.grid {
        session.check_grid(grid, 1)?;
    }
    let num_pixels = typed.grid.map_or(0, |grid| grid.num_pixels());
    let _claims = forming::claim(
        session,
        &typed.writing,
        &typed.input.paths,
        &typed.out,
        num_pixels,
    )?;

    let recorded = session.open(&typed.input)?;
    let survey = forming::survey(&recorded)?;
    let first_s = recorded.collection().pulses[0].time_s;
    let moving = typed.velocity.map(|v| Moving::new(&recorded, v, first_s));
    let moving = moving.transpose()?;
    let history: &dyn PhaseHistory = match &moving {
        Some(moving) => moving,
        None => &recorded,
    };
    let grid = forming::grid_or(session, typed.grid, &typed.out, || {
        session.default_grid(&survey)
    })?;
    session.note(1, || {
        let (columns, rows) = (grid.columns.count, grid.rows.count);
        format!(
            "{} pulses onto {columns} x {rows} pixels by {}",
            survey.num_pulses,
            former.name()
        )
    });

    let windows = [typed.window, typed.slow_window];
    let forming = Forming::new(session, history, &grid, windows);
    let Some((formed, check)) = form(session, typed, &*former, &forming)? else {
        return Ok(());
    };
    interrupt::check()?;
    let checksums = session.progress("checksums");
    let inputs = history.inputs()?;
    checksums.finish();
    let peak = Brightest::of(&formed.image, &grid);
    let record = record::Record {
        session,
        settings: record::settings(typed, former.name(), &formed.settings),
        grid: &grid,
        frame: &history.collection().frame,
        collection: forming::about(&survey, history)?,
        support: {
            let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
            RecordedLooks::of(history.collection(), middle_m, [grid.x_axis, grid.y_axis])
        },
        inputs: &inputs,
        check: check.as_ref(),
        peak,
        orientation: Orientation::of(history.collection(), &grid),
        taken: start.elapsed(),
    };
    let title = format!("{}, {}", survey.name, former.name());
    deliver(session, typed, &formed.image, &record, title)?;
    if let Some(check) = check
        && !session.json()
    {
        text::say(check.to_string())?;
    }
    Ok(())
}

/// Forms the image and checks it, if that is asked for; nothing if only what it takes was wanted.
fn form(
    session: &Session,
    typed: &Focus,
    former: &dyn ImageFormer,
    forming: &Forming<'_>,
) -> anyhow::Result<Option<(Formed, Option<check::Check>)>> {
    let progress = session.progress("focusing");
    let task = forming.task(&progress);
    let settings = forecast::Settings {
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
        sub_cpi: typed.sub_cpi,
        is_thesis: typed.mode == Some(Mode::Thesis),
    };
    let rehearsal = &typed.rehearsal;
    if forming::announce(session, rehearsal, former, &task, &settings, &typed.out)? {
        return Ok(None);
    }
    let checking = typed.check.map(|count| check::Plan::new(&task, count));
    let checking = checking.transpose()?;
    let formed = former
        .form_asked(&task, typed.misses())
        .map_err(with_advice)?;
    progress.finish();
    pass_on_warnings(&formed.settings);
    if formed.bound_missed {
        messages::bound_missed(format!(
            "the predicted error is {:.1} dB, above the {} dB asked",
            formed.predicted_error_db,
            former.bound_db().unwrap_or_default()
        ));
    }
    for (key, value) in &formed.settings {
        messages::setting(key, value);
    }
    let against_exact = |plan: check::Plan| {
        let progress = session.progress("checking");
        plan.against_exact(&forming.task(&progress), &formed.image)
    };
    let check = checking.map(against_exact).transpose()?;
    if let (Some(check), Some(bound_db)) = (&check, former.bound_db()) {
        check.judge(bound_db);
    }
    Ok(Some((formed, check)))
}

/// `error`, with what the command line can do about a missed bound.
fn with_advice(error: FormError) -> anyhow::Error {
    match error {
        FormError::BoundMissed { .. } => {
            anyhow::anyhow!(
                "{error}: raise --error-db, or take the best there is with --allow-error"
            )
        }
        error => error.into(),
    }
}

/// Writes the folder and says so.
fn deliver(
    session: &Session,
    typed: &Focus,
    image: &Image,
    record: &record::Record,
    title: String,
) -> anyhow::Result<()> {
    interrupt::check()?;
    let writing = session.progress("writing");
    let panel = Panel {
        scale: typed.look.scale(),
        colours: typed.look.colours(),
        orientation: record.orientation,
        ..Panel::new(image, record.grid, title.as_str())
    };
    let metadata = record.to_json(&title);
    forming::write(session, &typed.out, image, &panel, &metadata)?;
    writing.finish();
    let size = [image.rows, image.columns];
    tell(session, typed, size, record, metadata)
}

/// Says what was written: an image of so many rows and columns.
fn tell(
    session: &Session,
    typed: &Focus,
    [rows, columns]: [usize; 2],
    record: &record::Record,
    metadata: Value,
) -> anyhow::Result<()> {
    if session.json() {
        let mut metadata = metadata;
        metadata["folder"] = typed.out.display().to_string().into();
        return text::say_json("image", metadata);
    }
    if !session.tells() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} x {} pixels in {}",
        typed.out.display(),
        columns,
        rows,
        text::duration(record.taken)
    ))?;
    text::say(match record.peak {
        Some(peak) => {
            let [x, y, z] = peak.position_m;
            let level_db = peak.level_db;
            format!(
                "brightest point at x {x:.3} m, y {y:.3} m, z {z:.3} m: {}",
                text::decibels(level_db)
            )
        }
        None => "no brightest point: the image is zero".to_owned(),
    })?;
    Ok(())
}

/// What the former has to say of the image.
fn pass_on_warnings(settings: &Map<String, Value>) {
    let told = settings.get("warnings").and_then(Value::as_array);
    for warning in told.into_iter().flatten().filter_map(Value::as_str) {
        messages::warning(warning);
    }
}
