//! `subap demo`: simulate Table 4.1 of the thesis, focus it with every former, and report the errors.

mod report;
mod trials;
mod writing;

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::bail;
use serde_json::json;
use subaperture::focus::{FormError, Formed, Task};
use subaperture::image::{Comparison, Image};
use subaperture::io::claim::OutputClaims;
use subaperture::io::product::{self, Product};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::planner::forecast;
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};

use crate::ahead::Ahead;
use crate::args::Demo;
use crate::config::{Session, record_of_run};
use crate::{advice, interrupt, messages, text};
use trials::{GRID, Outcome, Trial, oracle, trials};

/// Upper limit on image-sized buffers in memory, and on disk: the exact image, an image and a difference for each former,
/// and one more for pictures.
const IMAGES: u64 = 20;

/// Simulate, focus, compare, and write all files under the folder.
pub(crate) fn run(session: &Session, typed: &Demo) -> anyhow::Result<()> {
    let start = Instant::now();
    let grid = match typed.grid.clone() {
        Some(grid) => grid,
        None => GRID.parse()?,
    };
    session.check_grid(&grid, IMAGES)?;
    let _claims = claim(session, typed)?;
    Product::prepare(&typed.out.join("exact"), grid.num_pixels() * IMAGES)?;

    let simulated = Preset::Table41.simulate(&Variation::default());
    let collection = simulated.collection();
    let weights = Weights::new(collection, Window::default(), Window::default());
    // A former includes its own image in its memory.
    let other_bytes = grid.num_pixels() * (IMAGES - 1) * 8;
    let task = Task {
        memory_bytes: session.memory_bytes - other_bytes,
        ..Task::new(&simulated, &grid, &weights)
    };
    if typed.rehearsal.dry_run {
        ahead(session, typed, &task)?.announce(session, &typed.rehearsal)?;
        return Ok(());
    }
    let (exact, exact_taken) = form(session, &task, &oracle());
    let exact = exact?;
    let outcomes = outcomes(session, typed, &task, &exact.image)?;
    interrupt::check()?;

    let Some(survey) = Survey::of(collection) else {
        bail!("the preset has no pulses")
    };
    let report = report::Report {
        outcomes: &outcomes,
        exact_taken,
        grating_lobe_m: survey.grating_lobe_m(130),
    };
    let files = writing::write(session, typed, &grid, &exact.image, &report, start)?;
    for outcome in outcomes.iter().filter(|outcome| outcome.misses_bound()) {
        messages::bound_missed(format!(
            "{} exceeds its bound; see the table",
            outcome.trial.title
        ));
    }
    if session.json() {
        let mut table = report.to_json();
        table["files"] = json!(files);
        table["run"] = record_of_run(session, start.elapsed());
        return text::say_json("demo", table);
    }
    text::say(report.to_text())?;
    if session.prints_text() {
        text::say(format!(
            "{}: images, differences, overview.png, errors.md, errors.json in {}",
            typed.out.display(),
            text::duration(start.elapsed())
        ))?;
    }
    Ok(())
}

/// Claim all output files. The claim lasts until the command ends.
fn claim(session: &Session, typed: &Demo) -> anyhow::Result<OutputClaims> {
    let mut claims = session.claims::<&Path>(&typed.writing, &[]);
    let folders: Vec<&str> = trials().iter().map(|trial| trial.folder).collect();
    let pictures = folders
        .iter()
        .map(|folder| format!("difference-{folder}.png"));
    let own = ["overview.png", "errors.md", "errors.json"].map(str::to_owned);
    claims.folder(&typed.out, pictures.chain(own))?;
    for folder in folders.iter().chain(&["exact"]) {
        claims.folder(&typed.out.join(folder), product::NAMES)?;
    }
    Ok(claims)
}

/// Form an image with one former. Returns the image and the time taken.
fn form(session: &Session, task: &Task, trial: &Trial) -> (Result<Formed, FormError>, Duration) {
    let progress = session.progress(trial.title);
    let begun = Instant::now();
    // The error of each image is measured and shown, so a missed bound is no failure here.
    let formed = trial.former.form_best(&Task {
        monitor: &progress,
        ..*task
    });
    (formed, begun.elapsed())
}

/// Form the images of all formers and compare each with the exact image.
fn outcomes(
    session: &Session,
    typed: &Demo,
    task: &Task,
    exact: &Image,
) -> anyhow::Result<Vec<Outcome>> {
    let mut outcomes = Vec::new();
    for mut trial in trials() {
        if typed.grid.is_some() {
            // Bounds are relative to an image that contains all bright scatterers of the scene.
            trial.bound_db = None;
        }
        let (formed, taken) = form(session, task, &trial);
        let formed = match formed {
            // On a grid given by the user, some formers may not apply.
            Err(error @ FormError::Unsuited(_)) if typed.grid.is_some() => {
                let why = advice::with_advice(&error);
                messages::warning(format!("{} is skipped: {why}", trial.title));
                continue;
            }
            formed => formed?,
        };
        let comparison = Comparison::between(&formed.image, exact)?;
        let difference = subtract(&formed.image, exact);
        let (image, settings) = (formed.image, formed.settings);
        outcomes.push(Outcome {
            trial,
            image,
            difference,
            comparison,
            settings,
            taken,
        });
    }
    Ok(outcomes)
}

/// Predicted cost of all images.
fn ahead(session: &Session, typed: &Demo, task: &Task) -> anyhow::Result<Ahead> {
    let progress = session.progress("measuring speed");
    let task = Task {
        monitor: &progress,
        ..*task
    };
    let (mut parts, mut count) = (Vec::new(), 0);
    for trial in std::iter::once(oracle()).chain(trials()) {
        count += 1;
        // A former that does not apply is skipped.
        parts.extend(forecast::forecast(&*trial.former, &task)?);
    }
    progress.finish();
    let (columns, rows) = (task.grid.columns.count, task.grid.rows.count);
    let image_bytes = 8 * task.grid.num_pixels();
    Ok(Ahead::new(
        session,
        format!("{count} images of {columns} x {rows} pixels"),
        task.history.held_bytes() + IMAGES * image_bytes,
        Some(parts.into_iter().sum()),
        vec![(typed.out.clone(), IMAGES * image_bytes)],
    ))
}

fn subtract(image: &Image, reference: &Image) -> Image {
    let pairs = image.pixels.iter().zip(&reference.pixels);
    Image {
        pixels: pairs.map(|(a, b)| a - b).collect(),
        ..*image
    }
}
