//! Descriptions of files other than recordings, by kind.

use std::fs;
use std::path::Path;

use anyhow::{Context, bail};
use serde_json::{Value, json};
use subaperture::images::OpenImage;
use subaperture::module::maps::Maps;
use subaperture::module::maps_file::MapFile;
use subaperture::{FileKind, recognise};

use super::description::{Description, line, read_record};
use super::{captures, images, texts, tracks};
use crate::commands::stored::product_folder;
use crate::config::Session;
use crate::text::{self, bytes};

/// Kind of the file at a path. Unrecognised files count as recordings, whose reader reports the expected formats.
pub(super) fn kind_of(path: &Path) -> FileKind {
    match recognise(path) {
        FileKind::Unknown => FileKind::Recording,
        kind => kind,
    }
}

/// Describe a file that is not a recording.
pub(super) fn describe(
    session: &Session,
    path: &Path,
    kind: &FileKind,
) -> anyhow::Result<Description> {
    match kind {
        FileKind::Maps => maps(path, session.memory_bytes),
        FileKind::Image => image(session, path),
        FileKind::Capture => captures::capture(path),
        FileKind::Experiment => captures::experiment(session, path),
        FileKind::Plan => texts::plan(session, path),
        FileKind::Record(schema) => texts::record(session, path, schema),
        FileKind::GeoJson => texts::features(session, path),
        FileKind::Scenario => texts::scenario(session, path),
        FileKind::Job => texts::job(session, path),
        FileKind::JobFolder => texts::job_folder(session, path),
        FileKind::Track => tracks::track(path),
        FileKind::Phases => tracks::phases(path),
        FileKind::MotionCapture => tracks::motion_capture(path),
        FileKind::Navigation => tracks::navigation(session, path),
        FileKind::Elevation => texts::file(path, "elevation model", "HGT: see --surface dem:FILE"),
        FileKind::Picture => texts::picture(path),
        FileKind::Kmz => texts::file(path, "map", "KMZ, ground overlays for Google Earth"),
        FileKind::Report => texts::file(path, "report", "written by subap, for a browser"),
        _ => bail!(
            "{}: expected a recording, an image folder (image.json) or a file of maps; found a folder without image.json: check the \
             path",
            path.display()
        ),
    }
}

/// Describe a product by its record, and any other image by its own metadata.
fn image(session: &Session, path: &Path) -> anyhow::Result<Description> {
    if let Some(folder) = product_folder(path) {
        let file = folder.join("image.json");
        if file.exists() {
            return product(path, folder, &read_record(session, &file)?);
        }
        if path.file_name().is_some_and(|name| name == "image.json") {
            fs::metadata(&file).with_context(|| format!("cannot read {}", file.display()))?;
        }
    }
    let image: OpenImage = crate::commands::stored::open(session, path)?;
    images::describe(&image)
}

fn product(path: &Path, folder: &Path, record: &Value) -> anyhow::Result<Description> {
    let mut text = line("image", &folder.display().to_string());
    let string = |value: &Value| value.as_str().map(str::to_owned);
    text += &axes_lines(record);
    if let Some(collection) = string(&record["collection"]["name"]) {
        text += &line("collection", &collection);
    }
    let settings = &record["settings"];
    if let Some(algorithm) = string(&settings["algorithm"]) {
        text += &line("former", &algorithm);
    }
    let windows = [&settings["window"], &settings["slow_window"]].map(string);
    if let [Some(fast), Some(slow)] = windows {
        text += &line(
            "windows",
            &format!("{fast} in fast time, {slow} in slow time"),
        );
    }
    text += &line("error", &error(record));
    if let (Some(level_db), Some([x, y, z])) = (
        record["brightest"]["level_db"].as_f64(),
        numbers(&record["brightest"]["position_m"]),
    ) {
        let place = format!(
            "x {x:.3} m, y {y:.3} m, z {z:.3} m: {}",
            text::decibels(level_db)
        );
        text += &line("brightest", &place);
    }
    for input in record["inputs"].as_array().into_iter().flatten() {
        let size = input["bytes"].as_u64().unwrap_or(0);
        let name = input["path"].as_str().unwrap_or("unnamed");
        text += &line("formed of", &format!("{name}, {}", bytes(size.into())));
    }
    for warning in record["warnings"].as_array().into_iter().flatten() {
        text += &line("warning", warning.as_str().unwrap_or_default());
    }
    let run = &record["run"];
    if let (Some(version), Some(seconds)) = (string(&run["version"]), run["run_time_s"].as_f64()) {
        let formed = format!("by subap {version} in {}", text::seconds(seconds));
        text += &line("formed", &formed);
    }
    Ok(Description {
        text,
        json: json!({ "path": path.display().to_string(), "kind": "image", "record": record }),
    })
}

/// Format the grid, by words or axis by axis.
fn axes_lines(record: &Value) -> String {
    let mut text = String::new();
    let axes = match record["grid"].is_object() {
        true => &record["grid"],
        false => &record["velocities"],
    };
    let axis = |name: &str| {
        let axis = &axes[name];
        let number = |key: &str| axis[key].as_f64();
        let (start, step, count) = (number("start")?, number("step")?, number("count")?);
        let end = start + step * (count - 1.0);
        let shown = |value| text::significant(value, 6);
        Some(format!(
            "{} from {} to {} by {}",
            axis["axis"].as_str().unwrap_or(name),
            shown(start),
            shown(end),
            shown(step)
        ))
    };
    if let Some(grid) = record["grid"].as_str() {
        text += &line("grid", grid);
    }
    for name in ["columns", "rows"] {
        if let Some(axis) = axis(name) {
            let count = axes[name]["count"].as_u64().unwrap_or(0);
            text += &line(name, &format!("{count}: {axis}"));
        }
    }
    if let Some(surface) = axes["relief"]["surface"].as_str() {
        text += &line("surface", surface);
    }
    text
}

/// Error bound, predicted error and measured error.
fn error(record: &Value) -> String {
    let resolved = &record["settings"]["resolved"];
    let mut parts = Vec::new();
    for (value, kind) in [
        (&resolved["error_db"], "asked"),
        (&resolved["predicted_error_db"], "predicted"),
        (&record["check"]["relative_to_image_db"], "measured"),
    ] {
        if let Some(error_db) = value.as_f64() {
            parts.push(format!("{error_db:.1} dB {kind}"));
        }
    }
    match parts.is_empty() {
        true => "unknown: neither predicted nor measured".to_owned(),
        false => parts.join(", "),
    }
}

fn numbers(value: &Value) -> Option<[f64; 3]> {
    let list = value.as_array()?;
    let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
    numbers.try_into().ok()
}

fn maps(path: &Path, memory_bytes: u64) -> anyhow::Result<Description> {
    let file = MapFile::open_within(path, memory_bytes)?;
    let run = file.run();
    let complete = match file.is_complete() {
        true => "whole",
        false => "truncated",
    };
    let bound = run.provenance.get("error_db").and_then(Value::as_f64);
    let mut text = line("maps", &path.display().to_string());
    text += &line("collection", &run.name);
    let count = format!("{} maps, {complete}", file.headers().len());
    text += &line("holds", &count);
    let setup = &run.setup;
    let size = format!(
        "{} pulses of {} frequencies",
        setup.num_pulses, setup.num_frequencies
    );
    text += &line("sub-CPI", &size);
    let arithmetic = serde_json::to_value(run.arithmetic)?;
    text += &line("arithmetic", arithmetic.as_str().unwrap_or("unknown"));
    text += &line("window", &run.fast_window);
    if let Some(error_db) = bound {
        text += &line("error", &format!("bound of the image {error_db} dB"));
    }
    let closing = file.closing();
    if let Some(missing) = closing.and_then(|closing| closing.counters.get("maps_missing")) {
        text += &line("missing", &format!("{missing} maps"));
    }
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "maps",
            "name": run.name,
            "maps": file.headers().len(),
            "complete": file.is_complete(),
            "setup": run.setup,
            "arithmetic": run.arithmetic,
            "fast_window": run.fast_window,
            "provenance": run.provenance,
            "counters": closing.map(|closing| &closing.counters),
        }),
    })
}
