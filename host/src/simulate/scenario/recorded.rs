//! A platform's recorded track from a file.

use std::path::Path;
use std::sync::Arc;

use crate::geometry::SceneFrame;
use crate::io::novatel::{self, Damage, Source};
use crate::io::track_csv;
use crate::simulate::body::Trajectory;
use crate::simulate::track::{Fix, Recorded};

use super::error::Found;
use super::values::Values;

/// The track in the platform's `file`.
pub(crate) fn build(
    values: &Values,
    frame: &SceneFrame,
    folder: &Path,
) -> Result<Arc<dyn Trajectory>, Found> {
    let path = folder.join(values.text("file"));
    let fixes = if values.text("kind") == "csv" {
        track_csv::read(&path).map_err(|error| values.fault("file", error.to_string()))?
    } else {
        log(values, &path, frame).map_err(|what| values.fault("file", what))?
    };
    let named = |error| values.fault("file", format!("{}: {error}", path.display()));
    Ok(Arc::new(Recorded::new(&fixes).map_err(named)?))
}

/// The records of a NovAtel log, times from its first on.
fn log(values: &Values, path: &Path, frame: &SceneFrame) -> Result<Vec<Fix>, String> {
    let damage = match values.flag("skip_damaged") {
        true => Damage::Skip,
        false => Damage::Refuse,
    };
    let source = match values.text("record") {
        "inspvax" => Source::Inspvax,
        "inspva" => Source::Inspva,
        _ => Source::Bestpos,
    };
    let log = novatel::read(path, damage).map_err(|error| error.to_string())?;
    let of_kind = log.records.iter().find(|record| record.source == source);
    let start = of_kind.map(|record| record.time);
    let start = start.ok_or_else(|| {
        format!(
            "{}: no record of this kind with a solution among {}: choose another 'record'",
            path.display(),
            log.records.len()
        )
    })?;
    let fixes = log.fixes(source, frame, start);
    fixes.map_err(|error| format!("{}: {error}", path.display()))
}
