//! `subap focus`: form an image from recordings and write it with its record.

pub(crate) mod beam;
mod check;
mod coarse;
mod deliver;
mod device;
mod from_maps;
mod job;
mod missed;
mod moving_targets;
mod on_track;
mod record;
mod sinks;
pub(crate) mod summary;
pub(crate) mod tiled;

use std::thread;
use std::time::Instant;

use serde_json::Value;
use subaperture::corrections::CorrectedRecording;
use subaperture::focus::accuracy::comparison_cost;
use subaperture::focus::{Formed, ImageFormer, Numerics, Plan, Task};
use subaperture::geometry::ImageGrid;
use subaperture::io::atomic::WriteError;
use subaperture::io::product::record::Brightest;
use subaperture::io::product::{self, Product};
use subaperture::monitor::Silent;

use crate::ahead::Ahead;
use crate::args::{Focus, TrackSource};
use crate::commands::forming::{self, Surveying};
use crate::commands::surface;
use crate::config::Session;
use crate::failure::Usage;
use crate::{stages, text};
pub(crate) use deliver::auxiliary_file;
use job::{Job, opened, products};

/// Form the image and write its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    let has_logs = !typed.logs.navigation.is_empty();
    match &typed.track {
        Some(TrackSource::Fused) => {}
        Some(TrackSource::Navigation) if !has_logs => {
            return Err(Usage("--track navigation needs --navigation LOG".to_owned()).into());
        }
        Some(TrackSource::Navigation) => {}
        _ if has_logs => {
            return Err(
                Usage("--navigation needs --track fused or --track navigation".to_owned()).into(),
            );
        }
        _ => {}
    }
    surface::check(&typed.image)?;
    if let Some(path) = &typed.from_maps {
        return from_maps::run(session, typed, path);
    }
    if let Some(path) = &typed.gmti {
        return moving_targets::run(session, typed, path);
    }
    if typed.tiled.wanted() {
        return tiled::run(session, typed);
    }
    if typed.image.forming.scratch.is_some() {
        return Err(Usage(
            "--scratch applies to --tiled and to plans only: leave it out".to_owned(),
        )
        .into());
    }
    let start = Instant::now();
    // Options are checked before any file is read.
    typed.image.forming.former.former()?;
    let model = forming::time_model(&typed.image)?;
    let device = device::open(typed.device);
    if let Some(grid) = &typed.image.grid.pixels {
        room(typed, grid)?;
    }
    let _claims = forming::claim(session, &typed.writing, &typed.input.files, &typed.out, 0)?;
    let products = products(typed);
    let _products = products.claim(session, &typed.input.files)?;

    let (recorded, movers) = opened(session, typed)?;
    let survey = Surveying::of(recorded.at_rest())?;
    products.check_place(&recorded.history().collection().frame)?;
    let job = Job {
        numerics: Numerics {
            device: device.as_deref(),
            ..typed.image.forming.numerics(model.as_ref())
        },
        session,
        typed,
        history: recorded.history(),
        survey: &survey,
        movers,
        start,
    };
    thread::scope(|scope| {
        // The survey is computed in a thread of its own while planning runs; without one, its first user computes it.
        let _ = thread::Builder::new().spawn_scoped(scope, || survey.get());
        let grid = job.grid()?;
        coarse::note(&job, &grid);
        note_delay(session, &recorded, &grid);
        room(typed, &grid)?;
        let former = beam::former(session, &typed.image, job.history, &grid)?;
        form_and_deliver(&job, &*former, &grid)
    })
}

/// Report the tropospheric delay that was corrected and its residual over a grid.
pub(crate) fn note_delay(session: &Session, recorded: &CorrectedRecording, grid: &ImageGrid) {
    if let Some(delay) = recorded.delay(grid) {
        session.note(1, || delay);
    }
}

/// Form the image on `grid` and write it.
fn form_and_deliver(job: &Job, former: &dyn ImageFormer, grid: &ImageGrid) -> anyhow::Result<()> {
    let Job { session, typed, .. } = *job;
    session.note(1, || {
        let (columns, rows) = (grid.columns.count, grid.rows.count);
        format!(
            "{} pulses onto {columns} x {rows} pixels by {}",
            job.history.collection().pulses.len(),
            former.name()
        )
    });
    let collection = job.history.collection();
    let weights = tiled::weights(&typed.image, former, collection, grid)?;
    let spec = tiled::spec(&typed.image, collection, grid, &weights, job.numerics);
    let task = Task {
        history: job.history,
        grid,
        weights: &weights,
        numerics: job.numerics,
        memory_bytes: session.memory_bytes,
        monitor: &Silent,
    };
    let plan = tiled::plan(session, &typed.image, former, &spec)?;
    device::note_unused(job.numerics.device, &plan.former, &plan.summary);
    let whole = 8 * grid.num_pixels() <= session.memory_bytes / 2;
    if announce(job, former, (&plan, whole), &task)? {
        return Ok(());
    }
    if !whole {
        let work = tiled::InParts { job, former, spec };
        return work.form_array(&plan);
    }
    let (formed, check) = form(job, former, &plan, &task)?;
    let settings = record::settings(job, former.name(), &formed.settings);
    let about = record::About {
        settings,
        check,
        peak: Brightest::of(&formed.image, grid),
    };
    job.deliver(
        grid,
        (former.name(), former.beam()),
        about,
        deliver::Whole::Memory(&formed.image),
        None,
    )
}

/// Measured error of the image in the output folder on `count` of its pixels, with the bound, as in `--check`.
pub(crate) fn checked(session: &Session, typed: &Focus, count: usize) -> anyhow::Result<Value> {
    let (recorded, _) = opened(session, typed)?;
    let history = recorded.history();
    let stored = product::open(&typed.out)?;
    let progress = session.progress("checking");
    let former = beam::former(session, &typed.image, history, &stored.grid)?;
    let collection = history.collection();
    let task = Task {
        history,
        grid: &stored.grid,
        weights: &tiled::weights(&typed.image, &*former, collection, &stored.grid)?,
        numerics: typed.image.forming.numerics(None),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let bound_db = former.bound_db();
    let plan = check::Plan::of_parts(&task, &stored.pixels, count)?;
    let check = plan.against_exact(&task, &stored.pixels, bound_db)?;
    progress.finish();
    let mut report = serde_json::to_value(check)?;
    report["bound_db"] = bound_db.into();
    Ok(report)
}

/// Check that an image of this size can be written.
fn room(typed: &Focus, grid: &ImageGrid) -> anyhow::Result<()> {
    Product::prepare(&typed.out, grid.num_pixels()).map_err(|error| match error {
        WriteError::NoSpace { .. } => anyhow::Error::from(error).context(format!(
            "--grid has {} x {} pixels, an image of {}",
            grid.columns.count,
            grid.rows.count,
            text::bytes(u128::from(grid.num_pixels()) * 8)
        )),
        error => error.into(),
    })
}

/// Print the predicted cost of the image, formed in memory as a `whole` or tile by tile. Returns whether this was a dry run.
fn announce(
    job: &Job,
    former: &dyn ImageFormer,
    (plan, whole): (&Plan, bool),
    task: &Task,
) -> anyhow::Result<bool> {
    let Job { session, typed, .. } = *job;
    let progress = session.progress("measuring");
    stages::show_predicted(session, &plan.cost, &comparison_cost(&task.spec()));
    let task = Task {
        monitor: &progress,
        ..*task
    };
    let rehearsal = &typed.rehearsal;
    let cost = (former, &plan.cost);
    let mut ahead = Ahead::of_image(session, rehearsal, cost, &task, &typed.out)?;
    if rehearsal.dry_run {
        ahead = ahead.with_reading((former, plan), &task, whole)?;
    }
    progress.finish();
    ahead.announce(session, rehearsal)
}

/// Form the image in memory and compare it with the exact sum if requested.
fn form(
    job: &Job,
    former: &dyn ImageFormer,
    plan: &Plan,
    task: &Task,
) -> anyhow::Result<(Formed, Option<check::Check>)> {
    let Job { session, typed, .. } = *job;
    let progress = session.progress("focusing");
    let image_bytes = 8 * task.grid.num_pixels();
    let checking = typed
        .check
        .map(|count| check::Plan::new(task, image_bytes, count));
    let checking = checking.transpose()?;
    let formed = stages::measured(session, &progress, |monitor| {
        plan.form(former, &Task { monitor, ..*task })
    });
    let formed = formed.map_err(|error| missed::refusal(error, former, &task.spec(), &progress))?;
    record::report_settings(&formed.settings);
    if formed.bound_missed {
        missed::warn(former, &task.spec(), formed.predicted_error_db, &progress);
    }
    progress.finish();
    let against_exact = |plan: check::Plan| {
        let progress = session.progress("checking");
        let task = Task {
            monitor: &progress,
            ..*task
        };
        plan.against_exact(&task, &formed.image, former.bound_db())
    };
    let check = checking.map(against_exact).transpose()?;
    Ok((formed, check))
}
