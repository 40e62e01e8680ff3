//! Descriptions of tracks, phases, motion capture and navigation logs.

use std::path::Path;

use serde_json::json;
use subaperture::io::{motive, phase_csv, track_axes, track_csv};
use subaperture::navigation::Options;
use subaperture::track::Fix;

use super::description::{Description, line};
use crate::commands::navigation;
use crate::config::Session;
use crate::text::{metres, seconds};

/// Describe a track in CSV format.
pub(super) fn track(path: &Path) -> anyhow::Result<Description> {
    of_fixes(path, "track", &track_csv::read(path)?)
}

/// Describe motion capture of a rigid body.
pub(super) fn motion_capture(path: &Path) -> anyhow::Result<Description> {
    let fixes = motive::read(path, None, track_axes::TrackAxes::y_up())?;
    of_fixes(path, "motion capture", &fixes)
}

fn of_fixes(path: &Path, kind: &str, fixes: &[Fix]) -> anyhow::Result<Description> {
    let mut text = line(kind, &path.display().to_string());
    let lasts_s = match (fixes.first(), fixes.last()) {
        (Some(first), Some(last)) => last.time_s - first.time_s,
        _ => 0.0,
    };
    let length_m: f64 = fixes
        .windows(2)
        .map(|pair| pair[0].position_m.distance(pair[1].position_m))
        .sum();
    let attitudes = fixes.iter().filter(|fix| fix.attitude.is_some()).count();
    text += &line(
        "holds",
        &format!("{} fixes over {}", fixes.len(), seconds(lasts_s)),
    );
    text += &line("length", &metres(Some(length_m)));
    if let (Some(first), Some(last)) = (fixes.first(), fixes.last()) {
        for (label, fix) in [("from", first), ("to", last)] {
            let at = fix.position_m;
            let place = format!(
                "x {:.3} m, y {:.3} m, z {:.3} m at {:.4} s",
                at.x, at.y, at.z, fix.time_s
            );
            text += &line(label, &place);
        }
    }
    text += &line("attitudes", &attitudes.to_string());
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": kind,
            "fixes": fixes.len(),
            "seconds": lasts_s,
            "length_m": length_m,
            "attitudes": attitudes,
        }),
    })
}

/// Describe a file of pulse phases.
pub(super) fn phases(path: &Path) -> anyhow::Result<Description> {
    let phases = phase_csv::read(path)?;
    let mean_square = phases.iter().map(|p| p * p).sum::<f64>() / phases.len().max(1) as f64;
    let mut text = line("phases", &path.display().to_string());
    text += &line("holds", &format!("{} pulses", phases.len()));
    text += &line("RMS", &format!("{:.4} rad", mean_square.sqrt()));
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "phases",
            "pulses": phases.len(),
            "rms_rad": mean_square.sqrt(),
        }),
    })
}

/// Describe a navigation log as `subap navigation` does.
pub(super) fn navigation(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let log = navigation::read(session, path, &Options::default())?;
    let mut text = line("navigation log", &path.display().to_string());
    for described in navigation::lines(&log) {
        text += &described;
        text.push('\n');
    }
    let mut json = navigation::about(&log);
    json["path"] = path.display().to_string().into();
    json["kind"] = "navigation log".into();
    Ok(Description { text, json })
}
