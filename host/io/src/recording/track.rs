//! `[platform]`: motion of the antennas, measured or given by the mount.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::arrays::Source;
use crate::track_axes::TrackAxes;
use crate::{marker_swaps, motive, recorded_track, track_csv};
use subaperture_describe::error::Fault;
use subaperture_describe::values::Values;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{self, Fix, Pose, Rail, SampledTrack, Trajectory, turned};

/// Seconds per unit of arrays of times.
pub(super) fn unit_s(unit: &str) -> f64 {
    match unit {
        "ms" => 1e-3,
        "us" => 1e-6,
        "ns" => 1e-9,
        _ => 1.0,
    }
}

/// Track, and its interval of validity; `None` for all times.
pub(super) struct Track {
    pub(super) body: Arc<dyn Trajectory>,
    /// Trajectory of the receiver's body, if separate.
    pub(super) receiver: Option<Arc<dyn Trajectory>>,
    pub(super) span_s: Option<(f64, f64)>,
    /// Gaps within the interval.
    pub(super) gaps_s: Vec<(f64, f64)>,
    /// Warnings about the track, one sentence each.
    pub(super) warnings: Vec<String>,
}

impl Track {
    /// Whether the track is valid at a time.
    pub(super) fn is_valid_at(&self, time_s: f64) -> bool {
        self.span_s
            .is_none_or(|(from, to)| (from..=to).contains(&time_s))
            && self.gap_s(time_s).is_none()
    }

    /// The gap that contains a time.
    pub(super) fn gap_s(&self, time_s: f64) -> Option<(f64, f64)> {
        let within = |(from, to): &&(f64, f64)| *from < time_s && time_s < *to;
        self.gaps_s.iter().find(within).copied()
    }
}

/// Track of the platform. `times_s` are the times of the first and last of `count` pulses.
pub(super) fn build(
    values: &Values,
    source: &Source,
    frame: &SceneFrame,
    times_s: (f64, f64),
    count: usize,
) -> Result<Track, Fault> {
    let track = poses(values, source, frame, times_s, count)?;
    let Some(angles) = values.optional_vector("attitude") else {
        return Ok(track);
    };
    let attitude = turned(angles.x, angles.y, angles.z);
    let kept = |body| -> Arc<dyn Trajectory> { Arc::new(Kept { body, attitude }) };
    Ok(Track {
        body: kept(track.body),
        receiver: track.receiver.map(kept),
        span_s: track.span_s,
        gaps_s: track.gaps_s,
        warnings: track.warnings,
    })
}

/// Trajectory with a constant attitude.
#[derive(Debug)]
struct Kept {
    body: Arc<dyn Trajectory>,
    attitude: DQuat,
}

impl Trajectory for Kept {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            attitude: self.attitude,
            ..self.body.pose(time_s)
        }
    }
}

fn poses(
    values: &Values,
    source: &Source,
    frame: &SceneFrame,
    times_s: (f64, f64),
    count: usize,
) -> Result<Track, Fault> {
    let mut warnings = Vec::new();
    let fixes = match values.text("kind") {
        "arrays" => arrays(values, source, "positions")?,
        "csv" => {
            let fixes = track_csv::read(&source.folder.join(values.text("file")))
                .map_err(|error| values.fault("file", error.to_string()))?;
            let axes = axes(values)?;
            let turned = |fix: Fix| Fix {
                position_m: axes.turn(fix.position_m),
                attitude: fix.attitude.map(|attitude| axes.turn_attitude(attitude)),
                ..fix
            };
            fixes.into_iter().map(turned).collect()
        }
        "motive" => {
            let path = source.folder.join(values.text("file"));
            let fixes = motive::read(&path, values.optional_text("body"), axes(values)?)
                .map_err(|error| values.fault("file", error.to_string()))?;
            let named = |what: String| format!("{}: {what}", path.display());
            let (fixes, swapped) =
                marker_swaps::without(fixes).map_err(|what| values.fault("file", named(what)))?;
            warnings.extend(swapped.map(|swapped| named(swapped.to_string())));
            fixes
        }
        kind => {
            let body: Arc<dyn Trajectory> = match kind {
                "novatel" => {
                    let known = *frame != SceneFrame::Local;
                    recorded_track::build(values, known.then_some(frame), source.folder)?
                }
                "arc" => Arc::new(arc(values, times_s)?),
                "rail" => Arc::new(rail(values, times_s, count)?),
                _ => subaperture_describe::track::track(values, 0.5 * (times_s.0 + times_s.1))?,
            };
            return Ok(Track {
                body,
                receiver: None,
                span_s: None,
                gaps_s: Vec::new(),
                warnings: Vec::new(),
            });
        }
    };
    let key = match values.text("kind") {
        "arrays" => "times",
        _ => "file",
    };
    let track = match values.text("kind") {
        "motive" => SampledTrack::with_gaps(&fixes, LONGEST_GAP_S),
        _ => SampledTrack::new(&fixes),
    };
    let track = track.map_err(|error| values.fault(key, error.to_string()))?;
    let receiver: Option<Arc<dyn Trajectory>> = match values.optional_text("receiver_positions") {
        Some(_) => {
            let fixes = arrays(values, source, "receiver_positions")?;
            let track = SampledTrack::new(&fixes);
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
        gaps_s: match values.text("kind") {
            "motive" => gaps(&fixes),
            _ => Vec::new(),
        },
        warnings,
    })
}

/// Longest gap in a motion capture that is interpolated, in seconds; a person's step takes five times as long.
const LONGEST_GAP_S: f64 = 0.1;

/// Longer gaps between positions.
fn gaps(fixes: &[Fix]) -> Vec<(f64, f64)> {
    let pairs = fixes
        .windows(2)
        .map(|pair| (pair[0].time_s, pair[1].time_s));
    pairs
        .filter(|(from, to)| to - from > LONGEST_GAP_S)
        .collect()
}

/// Order of the file's axes.
fn axes(values: &Values) -> Result<TrackAxes, Fault> {
    match values.optional_text("axes") {
        Some(text) => text
            .parse()
            .map_err(|what: String| values.fault("axes", what)),
        None if values.text("kind") == "motive" => Ok(TrackAxes::y_up()),
        None => Ok(TrackAxes::PLAIN),
    }
}

/// Swinging arm. Without a rate, one swing takes the duration of the pulses.
fn arc(values: &Values, (first_s, last_s): (f64, f64)) -> Result<track::Arc, Fault> {
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

/// Rail. Without a speed, the motion takes the duration of the pulses.
fn rail(values: &Values, (first_s, last_s): (f64, f64), count: usize) -> Result<Rail, Fault> {
    let (from_m, to_m) = (values.vector("from"), values.vector("to"));
    if from_m.distance(to_m) < 1e-9 {
        return Err(values.fault("to", "the rail has no length: move one of its ends"));
    }
    Ok(Rail {
        from_m,
        to_m,
        speed_m_s: match (
            values.optional_number("speed"),
            values.optional_number("spacing"),
        ) {
            (Some(_), Some(_)) => {
                return Err(values.fault("spacing", "give either speed or spacing, not both"));
            }
            (Some(speed), None) => speed,
            (None, Some(spacing_m)) => {
                let way_m = spacing_m * count.saturating_sub(1) as f64;
                evenly(values, "speed", way_m, last_s - first_s)?
            }
            (None, None) => evenly(values, "speed", from_m.distance(to_m), last_s - first_s)?,
        },
        start_s: values.optional_number("start").unwrap_or(first_s),
    })
}

fn evenly(values: &Values, key: &str, amount: f64, duration_s: f64) -> Result<f64, Fault> {
    if duration_s > 0.0 {
        return Ok(amount / duration_s);
    }
    Err(Fault::new(
        &values.at,
        format!("all pulses have the same time, so that the speed is unknown: give '{key}'"),
    ))
}

/// Times, and positions from the array named by a key.
fn arrays(values: &Values, source: &Source, key: &str) -> Result<Vec<Fix>, Fault> {
    let unit_s = unit_s(values.text("times_unit"));
    let axes = axes(values)?;
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
                    "expected real numbers of shape [{1}, 3], a row for each of 'times', found shape {0:?}",
                    positions.shape,
                    times.len()
                ),
            ));
        }
    };
    let fix = |(&time, row): (&f64, &[f64])| Fix {
        time_s: time * unit_s,
        position_m: axes.turn(DVec3::from_slice(row) * unit_m),
        attitude: None,
    };
    Ok(times.iter().zip(rows.chunks_exact(3)).map(fix).collect())
}
