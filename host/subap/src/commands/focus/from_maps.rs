//! `subap focus --from-maps`: form an image from the embedded module's maps.

use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use subaperture::geometry::ImageGrid;
use subaperture::io::npy;
use subaperture::io::product::record::Brightest;
use subaperture::module::image::{
    MapsTask, Report, default_grid, forecast as forecast_of_maps, form, memory_bytes,
};
use subaperture::module::maps::Maps;
use subaperture::module::maps_file::MapFile;
use subaperture::plot::Orientation;

use super::deliver::{Whole, deliver};
use super::missed::with_advice;
use super::record::Record;
use crate::ahead::Ahead;
use crate::args::Focus;
use crate::commands::forming;
use crate::config::{DEFAULT_ERROR_DB, Session};
use crate::messages;

/// Form the image and write its folder, complete or not at all.
pub(super) fn run(session: &Session, typed: &Focus, path: &Path) -> anyhow::Result<()> {
    let start = Instant::now();
    if let Some(grid) = &typed.image.grid.pixels {
        session.check_grid(grid, 1)?;
    }
    let num_pixels = typed
        .image
        .grid
        .pixels
        .as_ref()
        .map_or(0, ImageGrid::num_pixels);
    let _claims = forming::claim(session, &typed.writing, &[path], &typed.out, num_pixels)?;

    let maps = MapFile::open_within(path, session.memory_bytes)?;
    if !maps.is_complete() {
        messages::warning(format!(
            "{} is truncated: the image uses its {} complete maps",
            path.display(),
            maps.headers().len()
        ));
    }
    let planned = maps.run().provenance.get("error_db");
    let planned = planned.and_then(Value::as_f64);
    let error_db = typed
        .image
        .forming
        .former
        .error_db()
        .or(planned)
        .unwrap_or(DEFAULT_ERROR_DB);
    let grid = forming::grid_or(session, typed.image.grid.pixels.clone(), &typed.out, || {
        Ok(default_grid(&maps, error_db)?)
    })?;
    let progress = session.progress("focusing");
    let task = MapsTask {
        maps: &maps,
        grid: &grid,
        error_db,
        bound_policy: typed.image.forming.bound_policy(),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    if typed.rehearsal.dry_run {
        let ahead = ahead(session, typed, &maps, &task)?;
        progress.finish();
        ahead.announce(session, &typed.rehearsal)?;
        return Ok(());
    }
    let (formed, report) = form(&task).map_err(with_advice)?;
    progress.finish();
    warn(&report, error_db, grid.num_pixels());
    for (key, value) in &formed.settings {
        messages::setting(key, value);
    }

    let run = maps.run();
    let record = Record {
        session,
        settings: json!({
            "algorithm": "from-maps",
            "window": run.fast_window,
            "given": { "grid": typed.image.grid.pixels.is_some(), "error_db": typed.image.forming.former.error_db() },
            "resolved": formed.settings,
        }),
        grid: &grid,
        frame: &run.frame,
        collection: about(&maps),
        seen: None,
        antennas: None,
        inputs: &[maps.input()?],
        check: None,
        peak: Brightest::of(&formed.image, &grid),
        orientation: Orientation::default(),
        taken: start.elapsed(),
    };
    let title = format!("{}, from maps", run.name);
    deliver(
        session,
        typed,
        Whole::Memory(&formed.image),
        &record,
        &title,
        None,
    )
}

/// Collection entry of the record, from the metadata of the maps.
fn about(maps: &MapFile) -> Value {
    let (run, closing) = (maps.run(), maps.closing());
    json!({
        "name": run.name,
        "setup": run.setup,
        "arithmetic": run.arithmetic,
        "provenance": run.provenance,
        "complete": maps.is_complete(),
        "pulses_sent": closing.map(|closing| closing.num_pulses),
        "counters": closing.map(|closing| &closing.counters),
    })
}

/// Predicted cost of the image.
fn ahead(
    session: &Session,
    typed: &Focus,
    maps: &MapFile,
    task: &MapsTask,
) -> anyhow::Result<Ahead> {
    let grid = task.grid;
    let (columns, rows) = (grid.columns.count, grid.rows.count);
    let num_maps = maps.headers().len();
    let work = format!("{num_maps} maps onto {columns} x {rows} pixels");
    let held_bytes = memory_bytes(task) as u64;
    let disk = vec![(typed.out.clone(), npy::file_bytes(grid.num_pixels()))];
    let time = forecast_of_maps(task)?;
    Ok(Ahead::new(session, work, held_bytes, time, disk))
}

/// Warn of missing maps, uncovered pixels and a missed error bound.
fn warn(report: &Report, error_db: f64, num_pixels: u64) {
    if report.maps_missing > 0 {
        let expected = report.sub_cpis.saturating_mul(report.patches as u64);
        messages::warning(format!(
            "{} of {expected} maps are missing: the aperture of their patches is shorter",
            report.maps_missing
        ));
    }
    if report.pixels_outside > 0 {
        messages::warning(format!(
            "{} of {num_pixels} pixels lie outside every patch and are zero: give a smaller --grid, or allow a larger error with --error-db",
            report.pixels_outside
        ));
    }
    if report.predicted_db > error_db {
        messages::bound_missed(format!(
            "the predicted error is {:.1} dB, above the bound --error-db {error_db}; interpolation between \
             map bins contributes {:.1} dB",
            report.predicted_db, report.kernel_db
        ));
    }
}
