//! Which pulses are used, when they were taken, and where the antennas were.

use super::arrays::Source;
use super::track::{self, Track};
use crate::description::error::Found;
use crate::description::values::Values;
use crate::geometry::SceneFrame;
use crate::simulate::radar::Antenna;
use crate::simulate::scenario::{radar, scene};

use glam::DVec3;

/// Pulses that are used.
pub(super) struct Pulses {
    pub(super) frame: SceneFrame,
    /// Whether times are known.
    pub(super) timed: bool,
    pub(super) chosen: Vec<Chosen>,
    pub(super) antennas: Antennas,
}

/// Transmitter and receiver on their way.
pub(super) struct Antennas {
    track: Track,
    /// On the body, body axes.
    offsets_m: [DVec3; 2],
}

impl Antennas {
    /// Where they are.
    pub(super) fn at_m(&self, time_s: f64) -> [DVec3; 2] {
        let pose = self.track.body.pose(time_s);
        let receiver = self.track.receiver.as_ref();
        let receiver = receiver.map_or(pose, |body| body.pose(time_s));
        let [transmitter_m, receiver_m] = self.offsets_m;
        [pose.point_m(transmitter_m), receiver.point_m(receiver_m)]
    }
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen {
    /// Index in the recording.
    pub(super) index: usize,
    pub(super) time_s: f64,
    /// Transmitter and receiver.
    pub(super) antennas_m: [DVec3; 2],
    /// Whether the platform moves.
    pub(super) moving: bool,
}

/// Half of the time over which a speed is taken, seconds: long against the noise of a track, short against a push.
const HALF_SPAN_S: f64 = 0.05;

/// Seconds in a unit of arrays of times.
pub(super) fn unit_s(unit: &str) -> f64 {
    match unit {
        "ms" => 1e-3,
        "us" => 1e-6,
        "ns" => 1e-9,
        _ => 1.0,
    }
}

/// The pulses that `[recording]` chooses of all `count`, or those `given`.
pub(super) fn select(
    top: &Values,
    source: &Source,
    count: usize,
    given: Option<&[usize]>,
) -> Result<Pulses, Found> {
    let recording = source.recording;
    let frame = match top.section("scene").optional_section("origin") {
        Some(origin) => scene::frame(origin),
        None => SceneFrame::Local,
    };
    let (times_s, timed) = times(top.section("radar"), source, count)?;
    let ends = times_s
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &t| {
            (low.min(t), high.max(t))
        });
    let platform = top.section("platform");
    let antennas = Antennas {
        offsets_m: [
            antenna(top.section("radar"), "transmitter", "T")?.offset_m,
            antenna(top.section("radar"), "receiver", "R")?.offset_m,
        ],
        track: track::build(platform, source, &frame, ends)?,
    };
    let track = &antennas.track;
    let first = recording.count("first") as usize;
    let most = recording
        .optional_count("count")
        .map_or(usize::MAX, |n| n as usize);
    let every = recording.count("every") as usize;
    if first >= count {
        return Err(recording.fault(
            "first",
            format!(
                "'first' is {first} and the pulses are numbered from 0 to {}: lower it",
                count - 1
            ),
        ));
    }
    if let Some(asked) = recording.optional_count("count")
        && asked > (count - first) as u64
    {
        return Err(recording.fault(
            "count",
            format!(
                "'count' is {asked} and from pulse {first} on there are {}: lower it, or leave it out to take all",
                count - first
            ),
        ));
    }
    let least_m_s = recording.number("moving_above");
    let only_moving = recording.text("pulses") == "moving";
    let mut chosen = Vec::new();
    let asked: Vec<usize> = match given {
        Some(given) => given.to_vec(),
        None => (first..count).take(most).step_by(every).collect(),
    };
    for index in asked {
        let time_s = times_s[index];
        let tracked = track
            .span_s
            .is_none_or(|(from, to)| (from..=to).contains(&time_s));
        let moving = tracked && speed_m_s(track, time_s) > least_m_s;
        if given.is_none() && only_moving && !moving {
            continue;
        }
        if given.is_none() && !tracked {
            return Err(outside(platform, track, index, time_s));
        }
        chosen.push(Chosen {
            index,
            time_s,
            antennas_m: antennas.at_m(time_s),
            moving,
        });
    }
    if chosen.is_empty() {
        return Err(recording.fault(
            "pulses",
            format!(
                "no pulse from {:.3} to {:.3} s on the platform's clock is one that moves: check \
                 radar.first_pulse, or lower moving_above",
                ends.0, ends.1
            ),
        ));
    }
    Ok(Pulses {
        frame,
        timed,
        chosen,
        antennas,
    })
}

fn outside(platform: &Values, track: &Track, index: usize, time_s: f64) -> Found {
    let (from, to) = track.span_s.unwrap_or_default();
    Found::new(
        &platform.at,
        format!(
            "pulse {index} is at {time_s:.3} s and the track is known from {from:.3} to {to:.3} s: check \
             radar.first_pulse, or choose other pulses"
        ),
    )
}

/// Times of all pulses on the platform's clock, and whether anything says them.
fn times(radar: &Values, source: &Source, count: usize) -> Result<(Vec<f64>, bool), Found> {
    let recording = source.recording;
    let first_s = radar.optional_number("first_pulse");
    let unit_s = unit_s(recording.text("times_unit"));
    if recording.optional_text("times").is_none() {
        let known = ["pri", "prf"]
            .iter()
            .any(|key| radar.optional_number(key).is_some());
        let pri_s = if known { radar::pri_s(radar)? } else { 1.0 };
        let start_s = first_s.unwrap_or(0.0);
        return Ok((
            (0..count).map(|n| start_s + n as f64 * pri_s).collect(),
            known,
        ));
    }
    if let Some(key) = ["pri", "prf"]
        .iter()
        .find(|key| radar.optional_number(key).is_some())
    {
        let what = "[recording] times says when pulses were taken: give either, not both";
        return Err(radar.fault(key, what));
    }
    let times = source.vector(recording, "times")?;
    if times.len() != count {
        return Err(recording.fault(
            "times",
            format!(
                "holds {} times for {count} pulses: check the array, and 'layout', which says what rows and columns \
                 of the samples are",
                times.len()
            ),
        ));
    }
    let on_platforms_clock = |&t: &f64| match first_s {
        // Differences first: milliseconds since 1970 leave float64 no digits to lose.
        Some(start_s) => start_s + (t - times[0]) * unit_s,
        // To the last digit, so that a track recorded at these times is known at all of them.
        None => t * unit_s,
    };
    Ok((times.iter().map(on_platforms_clock).collect(), true))
}

fn speed_m_s(track: &Track, time_s: f64) -> f64 {
    let (from, to) = track.span_s.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let (before, after) = (
        (time_s - HALF_SPAN_S).max(from),
        (time_s + HALF_SPAN_S).min(to),
    );
    let way_m = track
        .body
        .pose(after)
        .position_m
        .distance(track.body.pose(before).position_m);
    way_m / (after - before)
}

/// The one antenna of a kind.
fn antenna(values: &Values, section: &str, letter: &str) -> Result<Antenna, Found> {
    if let Some(second) = values.sections(section).get(1) {
        return Err(Found::new(
            &second.at,
            format!("a recording is of one {section}: describe each pair in a file of its own"),
        ));
    }
    let mut antennas = radar::antennas(values, section, letter)?;
    Ok(antennas.remove(0))
}
