//! A platform's recorded track from a file.

use std::path::Path;
use std::sync::Arc;

use crate::novatel::{self, Damage, Source};
use crate::track_csv;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{Fix, SampledTrack, Trajectory};

use subaperture_describe::error::Found;
use subaperture_describe::values::Values;

/// Farthest that a log's track may be from the scene's origin, metres: beyond, one of the two is a slip.
const FARTHEST_FROM_ORIGIN_M: f64 = 1e6;

/// The track in the platform's `file`. `frame` is where the text puts the scene; `None` if it does not say.
pub fn build(
    values: &Values,
    frame: Option<&SceneFrame>,
    folder: &Path,
) -> Result<Arc<dyn Trajectory>, Found> {
    let path = folder.join(values.text("file"));
    let fixes = if values.text("kind") == "csv" {
        track_csv::read(&path).map_err(|error| values.fault("file", error.to_string()))?
    } else {
        log(values, &path, frame).map_err(|what| values.fault("file", what))?
    };
    let named = |error| values.fault("file", format!("{}: {error}", path.display()));
    Ok(Arc::new(SampledTrack::new(&fixes).map_err(named)?))
}

/// The records of a NovAtel log, times from its first on.
fn log(values: &Values, path: &Path, frame: Option<&SceneFrame>) -> Result<Vec<Fix>, String> {
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
    let Some(first) = of_kind else {
        return Err(format!(
            "{}: no record of this kind with a solution among {}: choose another 'record'",
            path.display(),
            log.records.len()
        ));
    };
    let place = format!(
        "latitude = \"{:.5} deg\", longitude = \"{:.5} deg\" and height = \"{:.0} m\"",
        first.place.latitude_deg, first.place.longitude_deg, first.place.height_m
    );
    let Some(frame) = frame else {
        return Err(format!(
            "{}: the log has places on the Earth, and the text does not say where the scene is: add [scene.origin], \
             near the track, which begins at {place}",
            path.display()
        ));
    };
    let fixes = log.fixes(source, frame, first.time);
    let fixes = fixes.map_err(|error| format!("{}: {error}", path.display()))?;
    match fixes
        .iter()
        .map(|fix| fix.position_m.length())
        .find(|&r| r > FARTHEST_FROM_ORIGIN_M)
    {
        None => Ok(fixes),
        Some(away_m) => Err(format!(
            "{}: the track is {:.0} km from [scene.origin]: it begins at {place}",
            path.display(),
            away_m / 1e3
        )),
    }
}
