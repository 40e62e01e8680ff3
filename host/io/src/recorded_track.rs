//! Recorded track of a platform from a file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::track_csv;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{Fix, SampledTrack, Trajectory};
use subaperture_navigation::{Kind, Log, Options, Place};

use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_describe::track::{LogKeys, Record};

/// Maximum distance of a log's track from the scene origin in metres. A larger distance means that one of them is
/// wrong.
const FARTHEST_FROM_ORIGIN_M: f64 = 1e6;

/// Read the track of a CSV file.
///
/// # Errors
/// The file cannot be read, or is not a track.
pub fn csv(file: &Located<PathBuf>, folder: &Path) -> Result<Arc<dyn Trajectory>, Fault> {
    let path = folder.join(&**file);
    let fixes = track_csv::read(&path).map_err(|error| file.fault(error.to_string()))?;
    sampled(file, &path, &fixes)
}

/// Read the track of a NovAtel log. `frame` is the stated scene frame; `None` if it is not stated.
///
/// # Errors
/// The file cannot be read, has no such records, or lies far from the scene.
pub fn novatel(
    file: &Located<PathBuf>,
    keys: &LogKeys,
    frame: Option<&SceneFrame>,
    folder: &Path,
) -> Result<Arc<dyn Trajectory>, Fault> {
    let path = folder.join(&**file);
    let fixes = log(keys, &path, frame).map_err(|what| file.fault(what))?;
    sampled(file, &path, &fixes)
}

fn sampled(
    file: &Located<PathBuf>,
    path: &Path,
    fixes: &[Fix],
) -> Result<Arc<dyn Trajectory>, Fault> {
    let named = |error| file.fault(format!("{}: {error}", path.display()));
    Ok(Arc::new(SampledTrack::new(fixes).map_err(named)?))
}

/// Records of a NovAtel log, with times relative to the first.
fn log(keys: &LogKeys, path: &Path, frame: Option<&SceneFrame>) -> Result<Vec<Fix>, String> {
    let kind = match keys.record {
        Record::Inspvax => Kind::Inspvax,
        Record::Inspva => Kind::Inspva,
        Record::Bestpos => Kind::Bestpos,
    };
    let log = Log::read(path, &Options::default()).map_err(|error| error.to_string())?;
    if let (Some(fault), false) = (log.account.faults.first(), keys.skip_damaged) {
        return Err(match log.account.damaged() {
            0 => format!(
                "{}: {} records have times that do not ascend, the first {fault}; skip them with 'skip_damaged'",
                path.display(),
                log.account.disordered()
            ),
            _ => format!(
                "{}, {fault}; skip damaged lines with 'skip_damaged', or transfer the log again",
                path.display()
            ),
        });
    }
    let mut places = log
        .of(kind)
        .filter_map(|record| Some((record.time, record.place?)));
    let Some((start, Place::Earth(first))) = places.next() else {
        return Err(format!(
            "{}: no record of this kind with a solution among {}: choose another 'record'",
            path.display(),
            log.records.len()
        ));
    };
    let place = format!(
        "latitude = \"{:.5} deg\", longitude = \"{:.5} deg\" and height = \"{:.0} m\"",
        first.latitude_deg, first.longitude_deg, first.height_m
    );
    let Some(frame) = frame else {
        return Err(format!(
            "{}: the log has positions on the Earth, but the scene's origin is not stated: add [scene.origin], \
             near the track, which begins at {place}",
            path.display()
        ));
    };
    let fixes = log.fixes(kind, frame, start);
    let fixes = fixes.map_err(|error| format!("{}: {error}", path.display()))?;
    match fixes
        .iter()
        .map(|fix| fix.position_m.length())
        .find(|&r| r > FARTHEST_FROM_ORIGIN_M)
    {
        None => Ok(fixes),
        Some(away_m) => Err(format!(
            "{}: the track, which begins at {place}, is {:.0} km from [scene.origin]",
            path.display(),
            away_m / 1e3
        )),
    }
}
