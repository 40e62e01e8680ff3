//! `[platform]`: motion of the antennas, measured or given by the mount.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::arrays::Source;
use super::earth::{self, Bounded, Measured};
use super::keys::{MotionKeys, MotionKeysArrays, MotionKeysRail, PlatformKeys, RadarKeys};
use crate::track_axes::TrackAxes;
use crate::{marker_swaps, motive, recorded_track, track_csv};
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_describe::track::{self as described, line, segments};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{self, Fix, Pose, Rail, SampledTrack, Trajectory, turned};

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
    /// State vectors of an orbit, for their interpolation error.
    pub(super) bounded: Option<Bounded>,
}

impl Track {
    /// Track with an interval of validity, or valid at all times.
    pub(super) fn within(body: Arc<dyn Trajectory>, span_s: Option<(f64, f64)>) -> Self {
        Self {
            body,
            receiver: None,
            span_s,
            gaps_s: Vec::new(),
            warnings: Vec::new(),
            bounded: None,
        }
    }

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
    (platform, radar): (&PlatformKeys, &RadarKeys),
    source: &Source,
    frame: &SceneFrame,
    times_s: (f64, f64),
    count: usize,
) -> Result<Track, Fault> {
    let track = poses((platform, radar), source, frame, times_s, count)?;
    let Some(angles) = platform.attitude_rad else {
        return Ok(track);
    };
    let attitude = turned(angles.x, angles.y, angles.z);
    let kept = |body| -> Arc<dyn Trajectory> { Arc::new(Kept { body, attitude }) };
    Ok(Track {
        body: kept(track.body),
        receiver: track.receiver.map(kept),
        ..track
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
    (platform, radar): (&PlatformKeys, &RadarKeys),
    source: &Source,
    frame: &SceneFrame,
    times_s: (f64, f64),
    count: usize,
) -> Result<Track, Fault> {
    let middle_s = 0.5 * (times_s.0 + times_s.1);
    let body: Arc<dyn Trajectory> = match &platform.kind {
        MotionKeys::Arrays(keys) => {
            let along = |at: &Located<String>, velocities| {
                let measured = arrays(source, keys, at, velocities)?;
                curve(platform, radar, frame, measured, &|text| at.fault(text))
            };
            let receiver = platform.receiver_positions.as_ref();
            let receiver = receiver.map(|at| along(at, None)).transpose()?;
            return Ok(Track {
                receiver: receiver.map(|track| track.body),
                ..along(&keys.positions, platform.velocities.as_ref())?
            });
        }
        MotionKeys::Csv(keys) => {
            let fault = |error: String| keys.file.fault(error);
            let (fixes, velocities_m_s) = track_csv::read_states(&source.folder.join(&*keys.file))
                .map_err(|error| fault(error.to_string()))?;
            let measured = Measured {
                fixes,
                velocities_m_s,
            };
            return curve(platform, radar, frame, measured, &fault);
        }
        MotionKeys::Motive(keys) => {
            let fault = |error: String| keys.file.fault(error);
            let path = source.folder.join(&*keys.file);
            let axes = axes(platform, TrackAxes::y_up())?;
            let fixes = motive::read(&path, platform.body.as_deref(), axes)
                .map_err(|error| fault(error.to_string()))?;
            let named = |what: String| format!("{}: {what}", path.display());
            let (fixes, swapped) =
                marker_swaps::without(fixes).map_err(|what| fault(named(what)))?;
            let body = SampledTrack::with_gaps(&fixes, LONGEST_GAP_S)
                .map_err(|error| fault(error.to_string()))?;
            return Ok(Track {
                gaps_s: gaps(&fixes),
                warnings: (swapped.into_iter())
                    .map(|swapped| named(swapped.to_string()))
                    .collect(),
                ..sampled(body, &fixes)
            });
        }
        MotionKeys::Novatel(keys) => {
            let known = *frame != SceneFrame::Local;
            let frame = known.then_some(frame);
            recorded_track::novatel(&keys.file, &keys.log, frame, source.folder)?
        }
        MotionKeys::Arc(arc) => {
            // Without a rate, one swing takes the duration of the pulses.
            let swing_rad = (arc.to_angle_rad - arc.from_angle_rad).abs();
            Arc::new(track::Arc {
                pivot_m: arc.pivot_m,
                radius_m: arc.radius_m,
                from_rad: arc.from_angle_rad,
                to_rad: arc.to_angle_rad,
                rate_rad_s: match platform.rate_rad_s {
                    Some(rate) => rate,
                    None => evenly(platform, "rate", swing_rad, times_s)?,
                },
                start_s: platform.start_s.unwrap_or(times_s.0),
            })
        }
        MotionKeys::Rail(keys) => Arc::new(rail(platform, keys, times_s, count)?),
        MotionKeys::Linear(keys) => {
            line(keys.position_m, keys.velocity_m_s, keys.at.time_s(middle_s))
        }
        MotionKeys::Fixed(keys) => line(keys.position_m, DVec3::ZERO, 0.0),
        MotionKeys::Circular(keys) => {
            let speed_m_s = platform.speed_m_s.ok_or_else(|| {
                let message =
                    "motion on a circle needs 'speed': write for example speed = \"0.1 m/s\"";
                Fault::new(&platform.header, message)
            })?;
            let at_s = keys.at.time_s(middle_s);
            keys.turn
                .circle(keys.centre_m, keys.radius_m, speed_m_s, at_s)
        }
        MotionKeys::Waypoints(keys) => segments(&keys.points)?,
        MotionKeys::Spline(keys) => described::curve(&keys.points)?,
    };
    Ok(Track::within(body, None))
}

/// Track through measured positions.
fn curve(
    platform: &PlatformKeys,
    radar: &RadarKeys,
    frame: &SceneFrame,
    measured: Measured,
    fault: &dyn Fn(String) -> Fault,
) -> Result<Track, Fault> {
    let axes = axes(platform, TrackAxes::PLAIN)?;
    let curve = earth::curve(platform, radar, (frame, axes), measured, fault)?;
    Ok(Track {
        bounded: curve.bounded,
        ..Track::within(curve.body, curve.span_s)
    })
}

/// Track through fixes, valid between the first and the last.
fn sampled(body: SampledTrack, fixes: &[Fix]) -> Track {
    let ends = fixes.first().zip(fixes.last());
    let span_s = ends.map(|(first, last)| (first.time_s, last.time_s));
    Track::within(Arc::new(body), span_s)
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

/// Order of the file's axes, or the usual one.
pub(super) fn axes(platform: &PlatformKeys, usual: TrackAxes) -> Result<TrackAxes, Fault> {
    match &platform.axes {
        Some(text) => text.parse().map_err(|what: String| text.fault(what)),
        None => Ok(usual),
    }
}

/// Rail. Without a speed, the motion takes the duration of the pulses.
fn rail(
    platform: &PlatformKeys,
    keys: &MotionKeysRail,
    times_s: (f64, f64),
    count: usize,
) -> Result<Rail, Fault> {
    let length_m = keys.from_m.distance(*keys.to_m);
    if length_m < 1e-9 {
        return Err(keys
            .to_m
            .fault("the rail has no length: move one of its ends"));
    }
    Ok(Rail {
        from_m: keys.from_m,
        to_m: *keys.to_m,
        speed_m_s: match (platform.speed_m_s, &platform.spacing_m) {
            (Some(_), Some(spacing)) => {
                return Err(spacing.fault("give either speed or spacing, not both"));
            }
            (Some(speed), None) => speed,
            (None, Some(spacing_m)) => {
                let way_m = **spacing_m * count.saturating_sub(1) as f64;
                evenly(platform, "speed", way_m, times_s)?
            }
            (None, None) => evenly(platform, "speed", length_m, times_s)?,
        },
        start_s: platform.start_s.unwrap_or(times_s.0),
    })
}

/// Rate of an amount that is spread over the pulses; `key` states it otherwise.
fn evenly(
    platform: &PlatformKeys,
    key: &str,
    amount: f64,
    (first_s, last_s): (f64, f64),
) -> Result<f64, Fault> {
    if last_s > first_s {
        return Ok(amount / (last_s - first_s));
    }
    Err(Fault::new(
        &platform.header,
        format!("all pulses have the same time, so that the speed is unknown: give '{key}'"),
    ))
}

/// Times, positions and velocities of arrays.
fn arrays(
    source: &Source,
    keys: &MotionKeysArrays,
    positions: &Located<String>,
    velocities: Option<&Located<String>>,
) -> Result<Measured, Fault> {
    let (unit_s, unit_m) = (keys.times_unit.seconds(), keys.positions_unit.metres());
    let times = source.vector(&keys.times)?;
    let rows = |key: &Located<String>| -> Result<Vec<DVec3>, Fault> {
        let array = source.array(key)?;
        match (array.real(), &array.shape[..]) {
            (Some(rows), &[count, 3]) if count == times.len() => {
                Ok(rows.chunks_exact(3).map(DVec3::from_slice).collect())
            }
            _ => Err(key.fault(format!(
                "expected real numbers of shape [{1}, 3], a row for each of 'times', found shape {0:?}",
                array.shape,
                times.len()
            ))),
        }
    };
    let fix = |(&time, place): (&f64, DVec3)| Fix {
        time_s: time * unit_s,
        position_m: place * unit_m,
        attitude: None,
    };
    Ok(Measured {
        fixes: times.iter().zip(rows(positions)?).map(fix).collect(),
        velocities_m_s: velocities.map(rows).transpose()?,
    })
}
