//! Descriptions of plans, records, scenarios, jobs and other texts.

use std::path::Path;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::focus::Plan;
use subaperture::io::geojson;
use subaperture::io::input::open_file;
use subaperture::job::JobText;
use subaperture::simulate::scenario::Scenario;

use super::description::{Description, line, read_record, read_text};
use crate::commands::run::keys;
use crate::config::Session;
use crate::text::{bytes, significant};

/// Maximum number of values of a record to print.
const MAX_VALUES: usize = 24;
/// Maximum length of a value of a record to print, characters.
const LONGEST_VALUE: usize = 100;

/// Describe a plan of an image.
pub(super) fn plan(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let text = String::from_utf8(read_text(session, path)?)
        .with_context(|| format!("{}: not UTF-8", path.display()))?;
    let plan = Plan::from_text(&text).with_context(|| path.display().to_string())?;
    let grid = &plan.grid;
    let mut text = line("plan", &path.display().to_string());
    text += &line("former", &plan.former);
    text += &line(
        "pixels",
        &format!("{} rows x {} columns", grid.rows.count, grid.columns.count),
    );
    text += &line(
        "windows",
        &format!(
            "{} in fast time, {} in slow time",
            plan.window, plan.slow_window
        ),
    );
    let bound = plan
        .bound_db
        .map_or_else(|| "no bound".to_owned(), |db| format!("bound {db:.1} dB"));
    text += &line(
        "error",
        &format!("{bound}, planned {:.1} dB", plan.planned_db),
    );
    text += &line(
        "recording",
        &format!(
            "{} pulses of {} frequencies, geometry {}",
            plan.recording.pulses, plan.recording.samples, plan.recording.geometry
        ),
    );
    text += &line("next", "execute it with subap focus INPUT --plan PLAN");
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "plan",
            "former": plan.former,
            "grid": grid,
            "bound_db": plan.bound_db,
            "planned_db": plan.planned_db,
            "recording": plan.recording,
        }),
    })
}

/// Describe a record of this program: its schema and values.
pub(super) fn record(session: &Session, path: &Path, schema: &str) -> anyhow::Result<Description> {
    let record = read_record(session, path)?;
    let mut text = line("record", &path.display().to_string());
    text += &line("schema", schema);
    let mut values = Vec::new();
    flat("", &record, &mut values);
    let count = values.len();
    for (key, value) in values.into_iter().take(MAX_VALUES) {
        text += &line(&key, &value);
    }
    if count > MAX_VALUES {
        text += &line("", &format!("and {} more values", count - MAX_VALUES));
    }
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "record",
            "record_schema": schema,
            "record": record,
        }),
    })
}

/// Flatten to scalar values by dotted keys, and lists to their lengths.
fn flat(prefix: &str, value: &Value, into: &mut Vec<(String, String)>) {
    let Some(object) = value.as_object() else {
        return;
    };
    for (key, value) in object {
        let key = match prefix {
            "" => key.clone(),
            prefix => format!("{prefix}.{key}"),
        };
        match value {
            _ if key == "schema" => {}
            Value::Object(_) => flat(&key, value, into),
            Value::Array(list) => into.push((key, format!("{} values", list.len()))),
            Value::Null => {}
            Value::Number(number) => {
                let shown = number.as_f64().map(|number| significant(number, 6));
                into.push((key, shown.unwrap_or_else(|| number.to_string())));
            }
            Value::String(text) => {
                into.push((key, text.chars().take(LONGEST_VALUE).collect()));
            }
            other => into.push((key, other.to_string())),
        }
    }
}

/// Describe a GeoJSON file, such as a STAC item.
pub(super) fn features(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let features = geojson::read(path, session.memory_bytes)?;
    let shapes: usize = features.iter().map(|feature| feature.shapes.len()).sum();
    let mut text = line("GeoJSON", &path.display().to_string());
    text += &line(
        "holds",
        &format!("{} features of {shapes} shapes", features.len()),
    );
    text += &line("next", "show it over an image with subap view --layer");
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "GeoJSON",
            "features": features.len(),
            "shapes": shapes,
        }),
    })
}

/// Describe a scenario of the simulator.
pub(super) fn scenario(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let scenario = Scenario::read_within(path, session.memory_bytes)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let scene = scenario.experiment_within(session.memory_bytes)?;
    let radar = &scene.radar;
    let pairs = radar.transmitters.len() * radar.receivers.len();
    let mut text = line("scenario", &path.display().to_string());
    text += &line("name", &scene.name);
    text += &line("antennas", &format!("{pairs} pairs of antennas"));
    text += &line("next", "simulate its recordings with subap simulate");
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "scenario",
            "name": scene.name,
            "pairs": pairs,
            "seed": scene.seed,
        }),
    })
}

/// Describe the text of a job.
pub(super) fn job(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let job = JobText::read(path, &keys::SCHEMA, "--set", &[], session.memory_bytes)?;
    let values = job.settings(&keys::section_names());
    let mut text = line("job", &path.display().to_string());
    let mut all = Vec::new();
    flat("", &Value::Object(values.clone()), &mut all);
    for (key, value) in all {
        text += &line(&key, &value);
    }
    text += &line("next", "run it with subap run");
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "job",
            "settings": values,
        }),
    })
}

/// Describe the output folder of a job.
pub(super) fn job_folder(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let mut described = record(session, &path.join("job.json"), "subaperture-job")?;
    described.text = line("job", &path.display().to_string()) + &described.text;
    described.json["kind"] = "job folder".into();
    Ok(described)
}

/// Describe a picture by its size.
pub(super) fn picture(path: &Path) -> anyhow::Result<Description> {
    let mut head = [0; 24];
    open_file(path)
        .and_then(|mut file| std::io::Read::read_exact(&mut file, &mut head))
        .with_context(|| format!("cannot read {}", path.display()))?;
    let number =
        |at: usize| u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let (across, down) = (number(16), number(20));
    let mut described = file(path, "picture", &format!("PNG, {across} x {down} pixels"))?;
    described.json["columns"] = across.into();
    described.json["rows"] = down.into();
    Ok(described)
}

/// Description of a file by kind and size.
pub(super) fn file(path: &Path, kind: &str, contents: &str) -> anyhow::Result<Description> {
    let size = std::fs::metadata(path)
        .with_context(|| format!("cannot read {}", path.display()))?
        .len();
    let text = line(kind, &path.display().to_string())
        + &line("format", contents)
        + &line("size", &bytes(size.into()));
    Ok(Description {
        text,
        json: json!({ "path": path.display().to_string(), "kind": kind, "format": contents, "bytes": size }),
    })
}
