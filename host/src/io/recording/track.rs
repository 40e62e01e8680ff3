//! `[platform]`: how the antennas moved, measured or as the mount makes them move.

use std::sync::Arc;

use glam::DVec3;

use super::arrays::Source;
use super::pulses::unit_s;
use crate::description::error::Found;
use crate::description::values::Values;
use crate::geometry::SceneFrame;
use crate::io::track_csv;
use crate::simulate::body::Trajectory;
use crate::simulate::scenario::{platform, recorded};
use crate::simulate::track::{self, Fix, Rail, Recorded};

/// A track, and the times that it is known for; all if `None`.
pub(super) struct Track {
    pub(super) body: Arc<dyn Trajectory>,
    /// What carries the receiver, if that is another body.
    pub(super) receiver: Option<Arc<dyn Trajectory>>,
    pub(super) span_s: Option<(f64, f64)>,
}

/// The platform's track. `times_s` are the first and the last pulse's.
pub(super) fn build(
    values: &Values,
    source: &Source,
    frame: &SceneFrame,
    times_s: (f64, f64),
) -> Result<Track, Found> {
    let fixes = match values.text("kind") {
        "arrays" => arrays(values, source, "positions")?,
        "csv" => track_csv::read(&source.folder.join(values.text("file")))
            .map_err(|error| values.fault("file", error.to_string()))?,
        kind => {
            let body: Arc<dyn Trajectory> = match kind {
                "novatel" => {
                    let known = *frame != SceneFrame::Local;
                    recorded::build(values, known.then_some(frame), source.folder)?
                }
                "arc" => Arc::new(arc(values, times_s)?),
                "rail" => Arc::new(rail(values, times_s)?),
                _ => platform::track(values, 0.5 * (times_s.0 + times_s.1))?,
            };
            return Ok(Track {
                body,
                receiver: None,
                span_s: None,
            });
        }
    };
    let key = if values.text("kind") == "csv" {
        "file"
    } else {
        "times"
    };
    let track = Recorded::new(&fixes).map_err(|error| values.fault(key, error.to_string()))?;
    let receiver: Option<Arc<dyn Trajectory>> = match values.optional_text("receiver_positions") {
        Some(_) => {
            let fixes = arrays(values, source, "receiver_positions")?;
            let track = Recorded::new(&fixes);
            Some(Arc::new(track.map_err(|error| {
                values.fault("receiver_positions", error.to_string())
            })?))
        }
        None => None,
    };
    Ok(Track {
        body: Arc::new(track),
        receiver,
        span_s: fixes
            .first()
            .zip(fixes.last())
            .map(|(a, b)| (a.time_s, b.time_s)),
    })
}

/// The swing takes as long as the pulses, unless its rate is given.
fn arc(values: &Values, (first_s, last_s): (f64, f64)) -> Result<track::Arc, Found> {
    let (from_rad, to_rad) = (values.number("from_angle"), values.number("to_angle"));
    Ok(track::Arc {
        pivot_m: values.vector("pivot"),
        radius_m: values.number("radius"),
        from_rad,
        to_rad,
        rate_rad_s: match values.optional_number("rate") {
            Some(rate) => rate,
            None => evenly(values, "rate", (to_rad - from_rad).abs(), last_s - first_s)?,
        },
        start_s: values.optional_number("start").unwrap_or(first_s),
    })
}

/// The way takes as long as the pulses, unless its speed is given.
fn rail(values: &Values, (first_s, last_s): (f64, f64)) -> Result<Rail, Found> {
    let (from_m, to_m) = (values.vector("from"), values.vector("to"));
    if from_m.distance(to_m) < 1e-9 {
        return Err(values.fault("to", "the rail has no length: move one of its ends"));
    }
    Ok(Rail {
        from_m,
        to_m,
        speed_m_s: match values.optional_number("speed") {
            Some(speed) => speed,
            None => evenly(values, "speed", from_m.distance(to_m), last_s - first_s)?,
        },
        start_s: values.optional_number("start").unwrap_or(first_s),
    })
}

fn evenly(values: &Values, key: &str, way: f64, duration_s: f64) -> Result<f64, Found> {
    if duration_s > 0.0 {
        return Ok(way / duration_s);
    }
    Err(Found::new(
        &values.at,
        format!("the pulses are all at one time, so nothing says how fast it goes: give '{key}'"),
    ))
}

/// Times, and positions from the array that a key names.
fn arrays(values: &Values, source: &Source, key: &str) -> Result<Vec<Fix>, Found> {
    let unit_s = unit_s(values.text("times_unit"));
    let times = source.vector(values, "times")?;
    let positions = source.array(values, key)?;
    let unit_m = match values.text("positions_unit") {
        "mm" => 1e-3,
        "cm" => 1e-2,
        _ => 1.0,
    };
    let rows = match (positions.real(), &positions.shape[..]) {
        (Some(rows), &[count, 3]) if count == times.len() => rows,
        _ => {
            return Err(values.fault(
                key,
                format!(
                    "has shape {:?}; real numbers of shape [{}, 3] are wanted, a row for each of 'times'",
                    positions.shape,
                    times.len()
                ),
            ));
        }
    };
    let fix = |(&time, row): (&f64, &[f64])| Fix {
        time_s: time * unit_s,
        position_m: DVec3::from_slice(row) * unit_m,
        attitude: None,
    };
    Ok(times.iter().zip(rows.chunks_exact(3)).map(fix).collect())
}
