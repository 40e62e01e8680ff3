//! `subap focus`: recordings in, an image and its record out.

mod check;
mod from_maps;
mod record;

use std::time::Instant;

use anyhow::Context;
use serde_json::{Map, Value};
use subaperture::focus::moving::Moving;
use subaperture::focus::{FormError, Task};
use subaperture::image::Image;
use subaperture::io::product::record::Brightest;
use subaperture::io::product::{self, Product};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::planner::forecast;
use subaperture::plot::{self, Orientation, Panel};
use subaperture::resolution::support::RecordedLooks;
use subaperture::resolution::survey::Survey;

use crate::ahead::Ahead;
use crate::args::{Focus, Mode};
use crate::config::{DEFAULT_ERROR_DB, Session, former};
use crate::{interrupt, messages, text};

/// Forms the image and writes its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    if let Some(path) = &typed.from_maps {
        return from_maps::run(session, typed, path);
    }
    let start = Instant::now();
    // What can be refused is refused before anything is read.
    let former = former(typed)?;
    if let Some(grid) = &typed.grid {
        session.check_grid(grid, 1)?;
    }
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    claims.folder(&typed.out, product::NAMES)?;
    Product::prepare(&typed.out, typed.grid.map_or(0, |grid| grid.num_pixels()))?;

    let recorded = session.open(&typed.input)?;
    let survey = Survey::of(recorded.collection()).context("the input holds no pulses")?;
    let first_s = recorded.collection().pulses[0].time_s;
    let moving = typed.velocity.map(|v| Moving::new(&recorded, v, first_s));
    let moving = moving.transpose()?;
    let history: &dyn PhaseHistory = match &moving {
        Some(moving) => moving,
        None => &recorded,
    };
    let grid = match typed.grid {
        Some(grid) => grid,
        None => {
            let grid = session.default_grid(&survey)?;
            session.check_grid(&grid, 1)?;
            Product::prepare(&typed.out, grid.num_pixels())?;
            grid
        }
    };
    session.note(1, || {
        let (columns, rows) = (grid.columns.count, grid.rows.count);
        format!(
            "{} pulses onto {columns} x {rows} pixels by {}",
            survey.num_pulses,
            former.name()
        )
    });

    let weights = Weights::new(history.collection(), typed.window, typed.slow_window);
    let progress = session.progress("focusing");
    let task = Task {
        history,
        grid: &grid,
        weights: &weights,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let settings = forecast::Settings {
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
        sub_cpi: typed.sub_cpi,
        is_thesis: typed.mode == Some(Mode::Thesis),
    };
    let ahead = Ahead::of_image(
        session,
        &typed.rehearsal,
        &*former,
        &task,
        &settings,
        &typed.out,
    )?;
    if ahead.announce(session, &typed.rehearsal)? {
        return Ok(());
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

    let check = match checking {
        None => None,
        Some(plan) => {
            let progress = session.progress("checking");
            let task = Task {
                monitor: &progress,
                ..task
            };
            Some(plan.against_exact(&task, &formed.image)?)
        }
    };
    if let (Some(check), Some(bound_db)) = (&check, former.bound_db()) {
        check.judge(bound_db);
    }
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
        collection: serde_json::to_value(&survey)?,
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
    let quicklook = plot::quicklook_within(
        &Panel {
            scale: typed.look.scale(),
            colours: typed.look.colours(),
            orientation: record.orientation,
            ..Panel::new(image, record.grid, title.as_str())
        },
        session.memory.picture_bytes,
    )?;
    let metadata = record.to_json(&title);
    Product {
        image,
        metadata: &metadata,
        quicklook: &quicklook,
    }
    .write(&typed.out)?;
    writing.finish();
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
        image.columns,
        image.rows,
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
