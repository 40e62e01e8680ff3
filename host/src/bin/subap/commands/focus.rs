//! `subap focus`: recordings in, an image and its record out.

mod check;
mod record;

use std::time::Instant;

use anyhow::Context;
use serde_json::{Map, Value};
use subaperture::focus::{Task, Weights};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::product::Product;
use subaperture::phase_history::PhaseHistory;
use subaperture::plot::{self, Panel};
use subaperture::survey::Survey;

use crate::args::Focus;
use crate::config::{Session, former};
use crate::{interrupt, text};

/// Forms the image and writes its folder, complete or not at all.
pub(crate) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    let start = Instant::now();
    // What can be refused is refused before anything is read.
    let former = former(typed)?;
    if let Some(grid) = &typed.grid {
        session.check_grid(grid)?;
    }
    Product::prepare(&typed.out, typed.grid.map_or(0, |grid| grid.num_pixels()))?;

    let history = session.open(&typed.input)?;
    let survey = Survey::of(history.collection()).context("the input holds no pulses")?;
    let grid = match typed.grid {
        Some(grid) => grid,
        None => {
            let grid = survey.default_grid()?;
            session.check_grid(&grid)?;
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
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let formed = former.form(&task)?;
    progress.finish();
    warn_of_missed_bound(session, &formed.settings);
    for (key, value) in &formed.settings {
        session.note(2, || format!("{key} = {value}"));
    }

    let check = match typed.check {
        None => None,
        Some(count) => {
            let progress = session.progress("checking");
            let task = Task {
                monitor: &progress,
                ..task
            };
            Some(check::against_exact(&task, &formed.image, count)?)
        }
    };
    interrupt::check()?;
    let inputs = history.inputs()?;
    let peak = brightest(&formed.image, &grid);
    let record = record::Record {
        session,
        typed,
        former: former.name(),
        settings: &formed.settings,
        grid: &grid,
        survey: &survey,
        collection: history.collection(),
        inputs: &inputs,
        check: check.as_ref(),
        peak,
        taken: start.elapsed(),
    };
    interrupt::check()?;
    let title = format!("{}, {}", survey.name, former.name());
    let quicklook = plot::quicklook(&Panel::new(&formed.image, &grid, title))?;
    let metadata = record.to_json();
    Product {
        image: &formed.image,
        metadata: &metadata,
        quicklook: &quicklook,
    }
    .write(&typed.out)?;

    if session.quiet() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} x {} pixels in {}",
        typed.out.display(),
        formed.image.columns,
        formed.image.rows,
        text::duration(start.elapsed())
    ))?;
    let [x, y, z] = peak.position_m;
    text::say(format!(
        "brightest point at x {x:.3} m, y {y:.3} m, z {z:.3} m: {:.2} dB",
        peak.level_db
    ))?;
    if let Some(check) = check {
        text::say(format!(
            "error against the exact sum on {} pixels: {:.1} dB of their power, {:.1} dB of an \
             average pixel's",
            check.num_pixels, check.relative_rms_db, check.relative_to_image_db
        ))?;
    }
    Ok(())
}

/// The planner takes the best there is where nothing meets the bound; the user should know.
fn warn_of_missed_bound(session: &Session, settings: &Map<String, Value>) {
    let number = |key: &str| settings.get(key).and_then(Value::as_f64);
    if let (Some(predicted_db), Some(error_db)) = (number("predicted_error_db"), number("error_db"))
        && predicted_db > error_db
        && !session.quiet()
    {
        eprintln!(
            "subap: the predicted error is {predicted_db:.1} dB, above the --error-db {error_db} \
             asked: leave out --sub-cpi and --patch, or use --algorithm exact"
        );
    }
}

/// The brightest pixel of an image.
#[derive(Clone, Copy, Debug, serde::Serialize)]
struct Peak {
    /// Where it is, metres in the scene frame.
    position_m: [f64; 3],
    /// Its magnitude, dB; 0 is a unit scatterer.
    level_db: f64,
    row: usize,
    column: usize,
}

fn brightest(image: &Image, grid: &ImageGrid) -> Peak {
    let powers = image.pixels.iter().map(|z| z.norm_sqr()).enumerate();
    let (index, power) = powers
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 0.0));
    let (row, column) = (index / image.columns, index % image.columns);
    Peak {
        position_m: grid.position_m(row, column).to_array(),
        // An image of nothing at all is as dark as a float can be, not minus infinity.
        level_db: 10.0 * f64::from(power.max(f32::MIN_POSITIVE)).log10(),
        row,
        column,
    }
}
